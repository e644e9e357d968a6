"""What every firmware program stands on: requests to the hardware, the meter, cost tables."""
