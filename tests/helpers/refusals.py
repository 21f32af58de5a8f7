"""What is refused: rows of a call, and of what its one sentence must name."""

import pytest

from jaxpf import InputError


def message_of(call, *arguments, error=InputError, **options):
    """The sentence with which a call is refused."""
    with pytest.raises(error) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message


def every(rows):
    """Parametrise a test by a table of refusals; a row's name is what must be named."""
    return pytest.mark.parametrize(("call", "named"), rows, ids=[named for _, named in rows])
