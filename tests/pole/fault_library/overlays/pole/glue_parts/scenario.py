def start_angle(file):
    """The angle (rad) that a scenario begins with."""
    return float(file.read_text().partition("angle_rad:")[2])
