"""How the command line ends where it is interrupted."""

import subprocess
import sys

INTERRUPT = """
import importlib.abc, signal, sys
class Interrupt(importlib.abc.MetaPathFinder):
    def find_spec(self, name, path, target=None):
        if name == {module!r}:
            try:
                signal.raise_signal(signal.SIGINT)
            except KeyboardInterrupt:
                {then}
signal.signal(signal.SIGINT, signal.default_int_handler)
sys.meta_path.insert(0, Interrupt())
"""


def interrupted_at(module, program, then="raise"):
    """Run a program with Ctrl-C when ``module`` is imported, which does ``then`` if it raises."""
    code = INTERRUPT.format(module=module, then=then) + program
    return subprocess.run([sys.executable, "-c", code], capture_output=True)


def test_ctrl_c_while_jax_is_imported_prints_no_traceback():
    arguments = "sys.argv = ['jaxpf', 'demo', '--runs', '1']\n"
    program = f"{arguments}from jaxpf.cli import main\nmain()\n"
    ended = interrupted_at("jax._src.core", program, then="sys.exit('crashed, as JAX may')")
    assert (ended.returncode, ended.stderr) == (130, b"Interrupted.\n")


def test_another_program_that_imports_the_command_line_keeps_its_ctrl_c():
    program = "try:\n    import jaxpf.cli\nexcept KeyboardInterrupt:\n    print('mine')\n"
    assert interrupted_at("click", program).stdout == b"mine\n"
