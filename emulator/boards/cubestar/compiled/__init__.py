"""What compiled code costs on CubeStar's processor: builds, operations, phases of a picture."""
