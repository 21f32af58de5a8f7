"""Files in and out: atomic writing, tracks, boxes, parts."""
