"""The wire: decodes requests, calls the engine, and answers with messages or statuses."""
