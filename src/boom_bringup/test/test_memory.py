import platform
import subprocess
import sys

import pytest

ASK = """
import resource
from boom_bringup.memory import keep_memory

def arrays():
    return [bytearray(2_000_000) for _ in range(40)]

{before}
arrays()
begin = resource.getrusage(resource.RUSAGE_SELF).ru_minflt
for _ in range(5):
    arrays()
print(resource.getrusage(resource.RUSAGE_SELF).ru_minflt - begin)
"""


def new_pages(before: str) -> int:
    done = subprocess.run([sys.executable, "-c", ASK.format(before=before)], capture_output=True, text=True, check=True)
    return int(done.stdout)


@pytest.mark.skipif(platform.libc_ver()[0] != "glibc", reason="this C library is not glibc: nothing to tell it")
def test_a_process_that_keeps_its_memory_gets_no_new_pages_for_what_it_has_had():
    assert new_pages("keep_memory()") < 0.1 * new_pages("")
