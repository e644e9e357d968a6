"""The EFM32GG280F1024 alone, without a board around it."""
