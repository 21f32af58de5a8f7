"""A file of boxes, and the one line that every refusal must be."""

import pytest

from jaxpf import InputError

GT = "frame,id,x,y,w,h,occ\n0,3,10,20,30,40,0\n0,1,11.5,21,31,41,2\n2,1,12,22,32,42,-1\n"


def message_of(call, *arguments, **options):
    with pytest.raises(InputError) as caught:
        call(*arguments, **options)
    message = str(caught.value)
    assert "\n" not in message
    return message
