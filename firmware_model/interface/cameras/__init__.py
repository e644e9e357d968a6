"""Control registers and frame timing of the image sensors."""
