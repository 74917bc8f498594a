"""Many large calls at once, from a process of their own: ADDRESS TOKEN METHOD CALLS BYTES. Prints the codes as JSON."""

import json
import sys
from collections import Counter

import grpc

UNKNOWN_FIELD = b"\x7a"  # field 15, length-delimited


def message(size: int) -> bytes:
    """A message of any type, of a little more than `size` bytes."""
    length, rest = bytearray(), size
    while rest > 0x7F:
        length.append(rest & 0x7F | 0x80)
        rest >>= 7
    return UNKNOWN_FIELD + bytes([*length, rest]) + bytes(size)


def main(address: str, token: str, method: str, calls: str, size: str) -> None:
    metadata = [("authorization", f"Bearer {token}")] if token else []
    body = message(int(size))
    codes = Counter()
    with grpc.insecure_channel(address, options=[("grpc.max_send_message_length", -1)]) as channel:
        # Every kind of call is one of streams on the wire.
        started = [
            channel.stream_stream(method)(iter([body]), metadata=metadata, wait_for_ready=True)
            for _ in range(int(calls))
        ]
        for call in started:
            try:
                next(call)
                call.cancel()
            except (grpc.RpcError, StopIteration):
                codes[call.code().name] += 1
            else:
                codes["ANSWERED"] += 1
    print(json.dumps(codes))


if __name__ == "__main__":
    main(*sys.argv[1:])
