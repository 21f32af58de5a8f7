"""jaxpf: particle filters for visual tracking of many, articulated and deformable objects."""
