"""firmware_model/cubestar."""
