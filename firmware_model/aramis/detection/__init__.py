"""From a picture to stars: background, spikes, regions, smear."""
