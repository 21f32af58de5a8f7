"""The one sentence that every refusal is."""

import pytest

from jaxpf import InputError


def message_of(call, *arguments, **options):
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message
