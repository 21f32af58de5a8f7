from .data import Annotated as Annotated, Contours as Contours, Learned as Learned
from .factory import to_contours as to_contours, tracker as tracker
from .models import contours_model as contours_model, start_space as start_space
