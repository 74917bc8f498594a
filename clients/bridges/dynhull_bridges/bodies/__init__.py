"""What is sent of an event: a CloudEvent, or what a template makes of it. A template is read from `template.py` on."""
