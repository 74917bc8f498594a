"""An object store that keeps its objects on a disk: s3rver, which speaks S3 for a folder."""

import re
import subprocess
from collections.abc import Iterator
from contextlib import contextmanager
from pathlib import Path

from forked import Process
from patience import PATIENCE
from peers import JAVASCRIPT, missing, program

BUCKET = "hulls"
OBJECT = "._S3rver_object"  # the end of the name of a file that is an object
# What pyarrow reads. The store does not take checksums after the content.
CREDENTIALS = {
    "AWS_ACCESS_KEY_ID": "S3RVER",
    "AWS_SECRET_ACCESS_KEY": "S3RVER",
    "AWS_EC2_METADATA_DISABLED": "true",
    "AWS_REQUEST_CHECKSUM_CALCULATION": "when_required",
}
ADDRESS = re.compile(r"listening on ([\d.]+:\d+)")


@contextmanager
def object_store(folder: Path) -> Iterator[str]:
    """The address of a store with a bucket, whose objects are files of a folder."""
    script = JAVASCRIPT / "node_modules" / "s3rver" / "bin" / "s3rver.js"
    if not script.is_file():
        missing("npm packages", "run `make peers`")
    options = ("-d", str(folder), "-a", "127.0.0.1", "-p", "0", "--configure-bucket", BUCKET)
    command = [program("node"), str(script), *options]
    with Process(command, stdout=subprocess.PIPE, stderr=subprocess.DEVNULL, text=True) as process:
        try:
            yield next(filter(None, map(ADDRESS.search, process.stdout)))[1]
        finally:
            process.kill()
            process.wait(PATIENCE)


def place(address: str, prefix: str) -> str:
    """The past in the bucket of a store, for a server."""
    return f"s3://{BUCKET}/{prefix}?scheme=http&region=us-east-1&endpoint_override={address}"
