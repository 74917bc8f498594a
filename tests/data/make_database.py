"""Write a PostgreSQL database with the installed version, as SQL: a fixture for the versions after it.

    PYTHONPATH=tests/support python tests/data/make_database.py tests/data/format8

By hand, with the last version that writes a format. The database has what the folder `stopped` beside it has, and a
batch that a server has added.
"""

import subprocess
import sys
from pathlib import Path

from postgresql import postgres_program, postgresql

from dynhull_client import HullClient

COMMAND = str(Path(sys.executable).with_name("dynhull"))


def main():
    folder = Path(sys.argv[1])
    with postgresql() as server:
        url = server.new_database()
        subprocess.run([COMMAND, "move", folder / "stopped", url], check=True)
        serve = [COMMAND, "serve", "--port", "0", "--journal", url]
        with subprocess.Popen(serve, stdout=subprocess.PIPE, text=True) as process:
            with HullClient(process.stdout.readline().split()[-1]) as client:
                client.apply("fleet", insert=[[7, 7]], producer="bus", sequence=5)
            process.terminate()
        dump = [postgres_program("pg_dump"), "--inserts", "--no-owner", "--no-privileges", "-d", url]
        lines = subprocess.run(dump, check=True, capture_output=True, text=True).stdout.splitlines()
    # Without comments, and what is only for psql.
    sql = [line for line in lines if line and not line.startswith(("--", "\\"))]
    (folder / "database.sql").write_text("\n".join(sql) + "\n")


if __name__ == "__main__":
    main()
