#include "inclusions_of_six.hpp"

RICOCHET_INCLUSIONS_WITHOUT_MODES_OF(6, 5, )
