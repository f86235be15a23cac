"""Films of runs: camera frames with the controller's view of them, and a viewer."""
