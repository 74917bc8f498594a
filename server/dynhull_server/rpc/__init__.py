"""The wire: decodes requests, asks the engine, answers with messages or statuses."""
