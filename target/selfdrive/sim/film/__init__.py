"""Films of runs: camera frames and the controller's view of them, and a viewer."""
