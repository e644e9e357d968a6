"""What camera models share: conditions, optics, exposure, imagers, pixel stream, registers."""
