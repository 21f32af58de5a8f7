"""How the command line ends where its output cannot be written, or where it is interrupted."""

import os
import signal
import subprocess
import sys
import time

import pytest

COMMAND = [sys.executable, "-m", "jaxpf.cli"]


@pytest.mark.skipif(not os.path.exists("/dev/full"), reason="a device of Linux")
@pytest.mark.parametrize("arguments", [["--help"], ["verdicts"], ["track", "--help-all"]])
def test_a_full_disk_under_standard_output_is_one_sentence(arguments):
    with open("/dev/full", "w") as full:
        ended = subprocess.run([*COMMAND, *arguments], stdout=full, stderr=subprocess.PIPE)
    assert ended.returncode == 2
    assert ended.stderr.decode().startswith("Error: cannot write the output: no space left")
    assert ended.stderr.count(b"\n") == 1


def test_ctrl_c_while_modules_are_imported_prints_no_traceback():
    program = (
        "import importlib.abc, os, signal, sys\n"
        "class Interrupt(importlib.abc.MetaPathFinder):\n"
        "    def find_spec(self, name, path, target=None):\n"
        "        if name == 'click':\n"
        "            signal.raise_signal(signal.SIGINT)\n"
        "sys.meta_path.insert(0, Interrupt())\n"
        "sys.argv = ['jaxpf', '--help']\n"
        "import jaxpf.cli\n"
    )
    ended = subprocess.run([sys.executable, "-c", program], capture_output=True, check=False)
    assert (ended.returncode, ended.stderr) == (130, b"Interrupted.\n")


@pytest.mark.slow
@pytest.mark.parametrize("delay", [0.1, 0.15, 0.2, 0.25, 0.3])
def test_ctrl_c_early_prints_no_traceback(delay):
    process = subprocess.Popen([*COMMAND, "verdicts"], stdout=-1, stderr=-1)
    time.sleep(delay)
    process.send_signal(signal.SIGINT)
    assert b"jaxpf/cli" not in process.communicate()[1]
