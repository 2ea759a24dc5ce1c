#include <fmt/format.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <string>
#include <string_view>

#include "base/read_file.hpp"
#include "base/strict_json.hpp"
#include "ricochet/faults/friction.hpp"

namespace ricochet {

namespace {

using nlohmann::json;

constexpr std::string_view format_name = "ricochet-friction-pair";
constexpr int format_version = 1;
constexpr std::size_t longest_file = 1 << 20;
constexpr int levels = 3;                            ///< the file, a net, a row
constexpr std::size_t longest_quotation = 60;        ///< of what was found
constexpr double highest_slip_rate = 299'792'458.0;  ///< [m/s] that of light
constexpr double largest_state = 700;                ///< e^xi is a double up to there
constexpr double lowest_slip_rate = 1e-100;          ///< [m/s] as a unit; quotients remain doubles
constexpr double largest_beta = 1e100;

class Reader {
public:
    Reader(const std::string& text, const std::string& name) : name_(name)
    {
        if (text.size() > longest_file) refuse("longer than a potential file may be");
        try {
            root_ = detail::parse_strictly(text, levels);
        } catch (const detail::JsonTooDeep&) {
            refuse("nested deeper than a potential file may be");
        } catch (const detail::JsonTrouble& trouble) {
            refuse(trouble.what());
        }
        if (!root_.is_object()) refuse("expected a JSON object");
    }

    [[nodiscard]] AdditivePair read() const
    {
        if (!holds(root_, "format", format_name)) {
            refuse(fmt::format("expected format \"{}\", found {}", format_name, found("format")));
        }
        if (!holds(root_, "version", format_version)) {
            refuse(fmt::format("expected version {}, found {}", format_version, found("version")));
        }
        if (!holds(root_, "convex", true)) {
            refuse(fmt::format("expected \"convex\": true, found {}", found("convex")));
        }
        AdditivePair::Parameters p;
        p.v_star = number(root_, "v_star", lowest_slip_rate, highest_slip_rate);
        p.beta = number(root_, "beta", 1 / largest_beta, largest_beta);
        p.direct = net("direct");
        p.state = net("state");
        p.rate = net("rate");
        p.domain = domain();
        const AdditivePair pair = convex_pair(p);
        self_test(pair);
        check_over_domain(pair);
        return pair;
    }

private:
    [[noreturn]] void refuse(const std::string& what) const
    {
        throw PotentialFileError(name_ + ": " + what);
    }

    [[nodiscard]] static bool holds(const json& in, const char* key, const json& value)
    {
        return in.contains(key) && std::string_view(in[key].type_name()) == value.type_name() &&
               in[key] == value;
    }

    [[nodiscard]] static std::string quoted(const json& in, const char* key)
    {
        if (!in.contains(key)) return "nothing";
        std::string text = in[key].dump(-1, ' ', true, json::error_handler_t::replace);
        if (text.size() > longest_quotation) text = text.substr(0, longest_quotation) + "...";
        return text;
    }

    [[nodiscard]] std::string found(const char* key) const { return quoted(root_, key); }

    [[nodiscard]] AdditivePair convex_pair(const AdditivePair::Parameters& p) const
    {
        try {
            return AdditivePair(p);
        } catch (const std::invalid_argument& error) {
            refuse(fmt::format("claims to be convex: {}", error.what()));
        }
    }

    /// Domain in which the pair was trained; all zero if it was not trained.
    [[nodiscard]] PairDomain domain() const
    {
        const json& in = object("domain");
        const PairDomain d{.v_min = number(in, "v_min"),
                           .v_max = number(in, "v_max"),
                           .xi_min = number(in, "xi_min"),
                           .xi_max = number(in, "xi_max")};
        const bool none = d.v_min == 0 && d.v_max == 0 && d.xi_min == 0 && d.xi_max == 0;
        if (none) return d;
        if (!(0 < d.v_min && d.v_min < d.v_max && d.v_max <= highest_slip_rate)) {
            refuse(fmt::format("\"domain\": expected 0 < v_min < v_max <= {} m/s, found {} and {}",
                               highest_slip_rate, d.v_min, d.v_max));
        }
        if (!(-largest_state <= d.xi_min && d.xi_min < d.xi_max && d.xi_max <= largest_state)) {
            refuse(fmt::format(
                "\"domain\": expected -{0} <= xi_min < xi_max <= {0}, found {1} and {2}",
                largest_state, d.xi_min, d.xi_max));
        }
        return d;
    }

    [[nodiscard]] const json& object(const char* key) const
    {
        if (!root_.contains(key) || !root_[key].is_object()) {
            refuse(fmt::format("\"{}\": expected an object, found {}", key, found(key)));
        }
        return root_[key];
    }

    [[nodiscard]] double number(const json& in, const char* key) const
    {
        if (!in.contains(key) || !in[key].is_number()) {
            refuse(fmt::format("\"{}\": expected a number, found {}", key, quoted(in, key)));
        }
        return in[key].get<double>();
    }

    [[nodiscard]] double number(const json& in, const char* key, double least, double most) const
    {
        const double value = number(in, key);
        if (!(least <= value && value <= most)) {
            refuse(fmt::format("\"{}\": expected a number from {} to {}, found {}", key, least,
                               most, value));
        }
        return value;
    }

    [[nodiscard]] MonotoneNet::Row row(const json& in, const char* net, const char* key,
                                       std::size_t& units) const
    {
        if (!in.contains(key) || !in[key].is_array() || in[key].size() > MonotoneNet::most_units) {
            refuse(fmt::format("\"{}\".\"{}\": expected at most {} numbers", net, key,
                               MonotoneNet::most_units));
        }
        MonotoneNet::Row out{};
        for (std::size_t i = 0; i < in[key].size(); ++i) {
            if (!in[key][i].is_number()) {
                refuse(fmt::format("\"{}\".\"{}\": expected numbers, found {}", net, key,
                                   quoted(in, key)));
            }
            out[i] = in[key][i].get<double>();
        }
        if (units != MonotoneNet::most_units + 1 && units != in[key].size()) {
            refuse(fmt::format("\"{}\".\"{}\": expected {} numbers, found {}", net, key, units,
                               in[key].size()));
        }
        units = in[key].size();
        return out;
    }

    [[nodiscard]] MonotoneNet net(const char* key) const
    {
        const json& in = object(key);
        MonotoneNet out;
        std::size_t units = MonotoneNet::most_units + 1;  // not known yet
        out.weight = row(in, key, "weight", units);
        out.scale = row(in, key, "scale", units);
        out.shift = row(in, key, "shift", units);
        out.units = units;
        out.offset = number(in, "offset");
        out.slope = number(in, "slope");
        return out;
    }

    /// Friction and rate are monotone in V and in xi: if they are finite in the corners they are
    /// finite between them.
    void check_over_domain(const AdditivePair& pair) const
    {
        const PairDomain& d = pair.parameters().domain;
        if (d.v_max == 0) return;  // there is none
        for (const double v : {d.v_min, d.v_max}) {
            for (const double xi : {d.xi_min, d.xi_max}) {
                const FrictionAndRate at = pair.evaluate(v, xi);
                if (std::isfinite(at.friction) && std::isfinite(at.rate)) continue;
                refuse(
                    fmt::format("\"domain\": friction is {} and the rate {} at v = {} m/s, xi = {}",
                                at.friction, at.rate, v, xi));
            }
        }
    }

    void self_test(const AdditivePair& pair) const
    {
        const json& test = object("self_test");
        const double v = number(test, "v");
        if (!(v > 0)) refuse(fmt::format("self test: \"v\" must be positive, found {}", v));
        const FrictionAndRate now = pair.evaluate(v, number(test, "xi"));
        // Another compiler may order the sums differently.
        const auto compare = [&](const char* what, double stored, double value) {
            if (!(std::abs(stored - value) <= 1e-12 * (std::abs(stored) + 1))) {
                refuse(fmt::format("self test: {} is {}, stored {}", what, value, stored));
            }
        };
        compare("friction", number(test, "friction"), now.friction);
        compare("rate", number(test, "rate"), now.rate);
    }

    std::string name_;
    json root_;
};

json net_json(const MonotoneNet& net)
{
    const auto list = [&](const MonotoneNet::Row& row) {
        return std::vector<double>(row.begin(), row.begin() + static_cast<long>(net.units));
    };
    return {{"offset", net.offset},
            {"slope", net.slope},
            {"weight", list(net.weight)},
            {"scale", list(net.scale)},
            {"shift", list(net.shift)}};
}

}  // namespace

AdditivePair parse_pair(const std::string& text, const std::string& name)
{
    return Reader(text, name).read();
}

AdditivePair load_pair(const std::filesystem::path& path)
{
    const auto refuse = [&](const std::string& why) {
        throw PotentialFileError(path.string() + ": " + why);
    };
    const std::string text = detail::read_file(path, refuse, longest_file);
    return parse_pair(text, path.string());
}

std::string to_json(const AdditivePair& pair)
{
    const AdditivePair::Parameters& p = pair.parameters();
    const double v = p.v_star / 3;
    const double xi = (p.domain.xi_min + p.domain.xi_max) / 2;
    const FrictionAndRate test = pair.evaluate(v, xi);
    const nlohmann::ordered_json out{
        {"format", format_name},
        {"version", format_version},
        {"convex", true},
        {"v_star", p.v_star},
        {"beta", p.beta},
        {"domain",
         {{"v_min", p.domain.v_min},
          {"v_max", p.domain.v_max},
          {"xi_min", p.domain.xi_min},
          {"xi_max", p.domain.xi_max}}},
        {"direct", net_json(p.direct)},
        {"state", net_json(p.state)},
        {"rate", net_json(p.rate)},
        {"self_test", {{"v", v}, {"xi", xi}, {"friction", test.friction}, {"rate", test.rate}}}};
    return out.dump(2) + '\n';
}

}  // namespace ricochet
