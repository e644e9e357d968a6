"""Common parts of the camera models: conditions, optics, exposure, imagers, streams, registers."""
