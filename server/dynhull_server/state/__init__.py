"""The state of the server: synchronous and pure. No asyncio, threads, clocks or I/O."""
