"""`dynhull alarms`: the alarms of a server and their events."""
