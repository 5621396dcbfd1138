"""`lapwing effects`: what each effect of a scene costs and changes, and which of them the scene could do without."""
