#include "mechanism_flight_of.hpp"

namespace ricochet::python {

template std::unique_ptr<MechanismFlight> make_flight<3>(MechanismCalls&);
template std::unique_ptr<MechanismFlight> make_flight<4>(MechanismCalls&);

}  // namespace ricochet::python
