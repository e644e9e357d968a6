"""Base of every firmware program: requests to the hardware, the meter, cost tables."""
