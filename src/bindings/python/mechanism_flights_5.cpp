#include "mechanism_flight_of.hpp"

namespace ricochet::python {

template std::unique_ptr<MechanismFlight> make_flight<5>(MechanismCalls&);
template std::unique_ptr<MechanismFlight> make_flight<6>(MechanismCalls&);

}  // namespace ricochet::python
