"""What acts against a hazard: specs of defences, their models, and how they are arranged into sets."""
