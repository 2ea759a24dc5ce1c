#include "json_text.hpp"

namespace ricochet::app {

std::string json_text(const Json& json)
{
    return json.dump(2, ' ', false, Json::error_handler_t::replace) + '\n';
}

}  // namespace ricochet::app
