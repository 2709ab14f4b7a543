"""Programs for people who own the robot: they talk to a running driver or read its bags."""
