#include "mechanism_flight_of.hpp"

namespace ricochet::python {

template std::unique_ptr<MechanismFlight> make_flight<1>(MechanismCalls&);
template std::unique_ptr<MechanismFlight> make_flight<2>(MechanismCalls&);

}  // namespace ricochet::python
