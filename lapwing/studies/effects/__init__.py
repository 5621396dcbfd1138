"""`lapwing effects`: cost and influence of each effect of a scene, and the smallest sufficient set."""
