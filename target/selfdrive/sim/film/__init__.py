"""Films of runs: what the camera showed and what the controller made of it, and how they are watched."""
