"""How the noise is adapted: pieces that any solver takes."""
