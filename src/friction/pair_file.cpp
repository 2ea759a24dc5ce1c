#include <fmt/format.h>

#include <cmath>
#include <fstream>
#include <iterator>
#include <nlohmann/json.hpp>

#include "ricochet/friction/additive_pair.hpp"

namespace ricochet {

namespace {

using nlohmann::json;

constexpr std::string_view format_name = "ricochet-friction-pair";
constexpr int format_version = 1;
constexpr std::size_t longest_file = 1 << 20;

class Reader {
public:
    Reader(const std::string& text, const std::string& name) : name_(name)
    {
        if (text.size() > longest_file) refuse("longer than a potential file may be");
        root_ = json::parse(text, nullptr, false);
        if (!root_.is_object()) refuse("expected a JSON object");
    }

    [[nodiscard]] AdditivePair read() const
    {
        if (root_.value("format", "") != format_name) {
            refuse(fmt::format("expected format \"{}\", found {}", format_name, found("format")));
        }
        if (root_.value("version", 0) != format_version) {
            refuse(fmt::format("expected version {}, found {}", format_version, found("version")));
        }
        if (!root_.contains("convex") || root_["convex"] != json(true)) {
            refuse(fmt::format("expected \"convex\": true, found {}", found("convex")));
        }
        AdditivePair::Parameters p;
        p.v_star = number(root_, "v_star");
        p.beta = number(root_, "beta");
        p.direct = net("direct");
        p.state = net("state");
        p.rate = net("rate");
        const json& domain = object("domain");
        p.domain = {number(domain, "v_min"), number(domain, "v_max"), number(domain, "xi_min"),
                    number(domain, "xi_max")};
        try {
            AdditivePair pair(p);
            self_test(pair);
            return pair;
        } catch (const std::invalid_argument& error) {
            refuse(fmt::format("claims to be convex: {}", error.what()));
        }
    }

private:
    [[noreturn]] void refuse(const std::string& what) const
    {
        throw PotentialFileError(name_ + ": " + what);
    }

    [[nodiscard]] std::string found(const char* key) const
    {
        return root_.contains(key) ? root_[key].dump() : "nothing";
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
            refuse(fmt::format("\"{}\": expected a number, found {}", key,
                               in.contains(key) ? in[key].dump() : "nothing"));
        }
        return in[key].get<double>();
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
                                   in[key][i].dump()));
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

    void self_test(const AdditivePair& pair) const
    {
        const json& test = object("self_test");
        const FrictionAndRate now = pair.evaluate(number(test, "v"), number(test, "xi"));
        // Another compiler may order the sums otherwise.
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
    std::ifstream in(path, std::ios::binary);
    if (!in) throw PotentialFileError(path.string() + ": cannot be read");
    const std::string text{std::istreambuf_iterator<char>(in), {}};
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
