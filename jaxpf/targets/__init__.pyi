from .building import factory as factory
from .registry import register as register
from .target import Looks as Looks, Marks as Marks, Start as Start, Target as Target
