"""Model-based finger gaits for multi-fingered hands, with a certificate of robustness."""
