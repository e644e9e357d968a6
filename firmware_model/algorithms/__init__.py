"""firmware_model/algorithms."""
