"""Hard skies: hazards as an option of experiments, and curves of what a sensor makes of them."""
