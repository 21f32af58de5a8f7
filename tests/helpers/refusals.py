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


def outside(ranges):
    """Parametrise a test by values outside of the ranges of arguments.

    Args:
        ranges: function -> name of an argument -> values.
    """
    rows = [
        (make, argument, value)
        for make, arguments in ranges.items()
        for argument, values in arguments.items()
        for value in values
    ]
    names = [f"{make.__name__}-{argument}" for make, argument, _ in rows]
    return pytest.mark.parametrize(("make", "argument", "value"), rows, ids=names)


def assert_names(make, argument, value):
    """The refusal of a value begins with the argument's name, and says what is allowed."""
    message = message_of(make, **{argument: value})
    assert message.startswith(argument), message
    assert any(words in message for words in (" must be ", "choose one of ", ": give ")), message
