"""What all camera models share: optics, exposure, pixel stream, registers."""
