"""AraMiS' star tracker firmware for the ADSP-BF533."""
