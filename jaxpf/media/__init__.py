"""Video and images in and out, drawing and plotting."""
