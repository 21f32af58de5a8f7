"""What a substate means: one ``Target`` per kind of object, which knows no filter.

How a target is read, written, drawn and asked for is said in ``jaxpf.targets``, where targets are
entered.
"""
