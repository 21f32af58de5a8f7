"""An ordering of one's own: half of the particles in order, half in reverse."""

import jaxpf


def there_and_back(scene):
    places = list(range(scene.num_objects))
    ordering = jaxpf.ordering.dps(orders=[places, places[::-1]])
    return jaxpf.boxes.tracker(
        scene.frames[0], scene.boxes[0], ordering=ordering, appearance="colour", num_particles=60
    )
