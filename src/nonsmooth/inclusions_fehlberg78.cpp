#include "ricochet/nonsmooth/solvers.hpp"

RICOCHET_EVENTS_OF(1, 1, Fehlberg78, )
RICOCHET_EVENTS_OF(3, 1, Fehlberg78, )
