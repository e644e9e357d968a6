"""firmware_model/interface."""
