#include "strict_json.hpp"

#include <nlohmann/json.hpp>
#include <set>
#include <vector>

namespace ricochet::detail {

nlohmann::json parse_strictly(std::string_view text, int levels)
{
    using nlohmann::json;
    std::vector<std::set<std::string>> keys;
    const auto inspect = [&](int depth, json::parse_event_t event, json& value) {
        switch (event) {
            case json::parse_event_t::object_start: keys.emplace_back(); [[fallthrough]];
            case json::parse_event_t::array_start:
                if (depth >= levels) {
                    throw JsonTooDeep("expected at most " + std::to_string(levels) +
                                      " levels of JSON, found more");
                }
                break;
            case json::parse_event_t::object_end: keys.pop_back(); break;
            case json::parse_event_t::key: {
                const auto& key = value.get_ref<const std::string&>();
                if (!keys.back().insert(key).second) {
                    throw JsonTrouble("key \"" + key + "\" appears twice");
                }
                break;
            }
            default: break;
        }
        return true;
    };
    try {
        return json::parse(text, inspect);
    } catch (const json::parse_error& error) {
        throw JsonTrouble("expected JSON, found an error at its byte " +
                          std::to_string(error.byte));
    } catch (const json::exception&) {
        throw JsonTrouble("expected JSON, found a number out of range");
    }
}

}  // namespace ricochet::detail
