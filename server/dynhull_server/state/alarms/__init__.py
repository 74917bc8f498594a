"""Alarms: for which hulls a condition about the outline holds, and since when.

An alarm is kept, numbered, committed and read as a fence is: its subjects are hulls as wholes, and those inside are the
ones for which it is raised. What differs is here: the rule, and what it says about each hull. The events are made in
`..fences.trip.alarms`.

conditions  their text: `area > 500 km2`, or `silent 5m`
rule        what raises and clears an alarm, and the names of alarms among those of fences
values      measures of a hull, and their comparison with a bound
watched     an alarm at its hulls, and when time decides something there
status      what an alarm says about a hull at present
"""
