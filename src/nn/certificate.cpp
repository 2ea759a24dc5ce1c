#include "ricochet/nn/mlp.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <bit>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <stdexcept>
#include <utility>

namespace ricochet {
namespace {

using Json = nlohmann::ordered_json;

/// FNV-1a hash of the data added to it.
class Hash {
public:
    void add(std::uint64_t value)
    {
        for (unsigned shift = 0; shift < 64; shift += 8) byte((value >> shift) & 0xffU);
    }
    void add(double value) { add(std::bit_cast<std::uint64_t>(value)); }
    void add(std::string_view text)
    {
        add(std::uint64_t{text.size()});
        for (const char c : text) byte(static_cast<unsigned char>(c));
    }
    void add(const std::vector<double>& values)
    {
        add(std::uint64_t{values.size()});
        for (const double value : values) add(value);
    }
    [[nodiscard]] std::uint64_t value() const noexcept { return hash_; }

private:
    void byte(std::uint64_t b) noexcept { hash_ = (hash_ ^ b) * 0x100000001b3U; }

    std::uint64_t hash_ = 0xcbf29ce484222325U;
};

[[noreturn]] void refuse_certificate(const std::string& what)
{
    throw std::invalid_argument("cannot be read: " + what);
}

Json json(const std::vector<ValueRange>& box)
{
    Json out = Json::array();
    for (const ValueRange& range : box) out.push_back(Json::array({range.lower, range.upper}));
    return out;
}

double number(const Json& value, std::string_view what)
{
    if (!value.is_number()) refuse_certificate(fmt::format("expected a number as {}", what));
    const double number = value.get<double>();
    if (!std::isfinite(number)) refuse_certificate(fmt::format("{} is not finite", what));
    return number;
}

const Json& member(const Json& object, const char* name)
{
    if (!object.is_object() || !object.contains(name))
        refuse_certificate(fmt::format("'{}' is missing", name));
    return object.at(name);
}

const Json& list(const Json& object, const char* name)
{
    const Json& found = member(object, name);
    if (!found.is_array()) refuse_certificate(fmt::format("expected '{}' to be a list", name));
    return found;
}

std::string text(const Json& object, const char* name)
{
    const Json& found = member(object, name);
    if (!found.is_string()) refuse_certificate(fmt::format("expected '{}' to be text", name));
    return found.get<std::string>();
}

std::vector<ValueRange> box(const Json& value)
{
    std::vector<ValueRange> out;
    if (!value.is_array()) refuse_certificate("expected a box to be a list of ranges");
    for (const Json& range : value) {
        if (!range.is_array() || range.size() != 2)
            refuse_certificate("expected a range to be two numbers");
        out.push_back(
            {number(range[0], "an end of a range"), number(range[1], "an end of a range")});
        if (!(out.back().lower <= out.back().upper))
            refuse_certificate("a range ends before it begins");
    }
    return out;
}

CertificateLevel level(const Json& from, std::size_t dimension)
{
    CertificateLevel out;
    out.margin = number(member(from, "margin"), "'margin'");
    out.threshold = number(member(from, "threshold"), "'threshold'");
    out.seconds = number(member(from, "seconds"), "'seconds'");
    const Json& boxes = member(from, "boxes");
    if (!boxes.is_number_unsigned()) refuse_certificate("expected 'boxes' to be a whole number");
    out.boxes = boxes.get<std::uint64_t>();
    for (const Json& one : list(from, "unproved")) {
        out.unproved.push_back(box(one));
        if (out.unproved.back().size() != dimension) {
            refuse_certificate(fmt::format("expected an unproved box of {} ranges, found {}",
                                           dimension, out.unproved.back().size()));
        }
    }
    return out;
}

bool same(const std::vector<ValueRange>& a, const std::vector<ValueRange>& b)
{
    return std::equal(a.begin(), a.end(), b.begin(), b.end(), [](ValueRange x, ValueRange y) {
        return x.lower == y.lower && x.upper == y.upper;
    });
}

}  // namespace

std::string fingerprint(const Model& model)
{
    const auto evaluated = [&](double x) {
        return model.precision == Precision::f32 ? static_cast<double>(static_cast<float>(x)) : x;
    };
    Hash hash;
    hash.add(model.system);
    hash.add(std::uint64_t{model.parameters.size()});
    for (const auto& [name, value] : model.parameters) {
        hash.add(name);
        hash.add(value);
    }
    hash.add(model.recipe);
    hash.add(model.offset);
    hash.add(model.scale);
    for (const ValueRange& range : model.domain) {
        hash.add(range.lower);
        hash.add(range.upper);
    }
    hash.add(std::uint64_t{model.activation == Activation::relu});
    hash.add(std::uint64_t{model.precision == Precision::f32});
    hash.add(model.threshold);
    for (const DenseLayer& layer : model.layers) {
        hash.add(std::uint64_t{layer.inputs});
        hash.add(std::uint64_t{layer.outputs});
        for (const double w : layer.weight) hash.add(evaluated(w));
        for (const double b : layer.bias) hash.add(evaluated(b));
    }
    return fmt::format("{:016x}", hash.value());
}

std::string to_text(const Certificate& certificate)
{
    Json parameters = Json::object();
    for (const auto& [name, value] : certificate.parameters) parameters[name] = value;
    Json levels = Json::array();
    for (const CertificateLevel& level : certificate.levels) {
        Json unproved = Json::array();
        for (const auto& box : level.unproved) unproved.push_back(json(box));
        levels.push_back({{"margin", level.margin},
                          {"threshold", level.threshold},
                          {"boxes", level.boxes},
                          {"seconds", level.seconds},
                          {"unproved", unproved}});
    }
    return Json{{"tool", certificate.tool},     {"fingerprint", certificate.fingerprint},
                {"system", certificate.system}, {"parameters", parameters},
                {"box", json(certificate.box)}, {"levels", levels}}
        .dump();
}

Certificate parse_certificate(std::string_view given)
{
    const Json from = Json::parse(given, nullptr, false);
    if (from.is_discarded()) refuse_certificate("it is no JSON");
    Certificate out;
    out.tool = text(from, "tool");
    out.fingerprint = text(from, "fingerprint");
    out.system = text(from, "system");
    const Json& parameters = member(from, "parameters");
    if (!parameters.is_object()) refuse_certificate("expected 'parameters' to be an object");
    for (const auto& [name, value] : parameters.items()) {
        out.parameters[name] = number(value, "a parameter");
    }
    out.box = box(member(from, "box"));
    for (const Json& one : list(from, "levels")) out.levels.push_back(level(one, out.box.size()));
    if (out.levels.empty()) refuse_certificate("it has no level");
    for (std::size_t k = 1; k < out.levels.size(); ++k) {
        if (!(out.levels[k].margin > out.levels[k - 1].margin) ||
            !(out.levels[k].threshold <= out.levels[k - 1].threshold)) {
            refuse_certificate("expected margins that rise and thresholds that do not");
        }
    }
    return out;
}

std::string why_void(const Model& model)
{
    const Certificate certificate = parse_certificate(model.certificate);
    if (certificate.system != model.system) {
        return fmt::format("is for the system '{}', the model for '{}'", certificate.system,
                           model.system);
    }
    if (certificate.parameters != model.parameters) return "is for other parameters";
    if (!same(certificate.box, model.domain)) return "is for another domain";
    if (certificate.levels.front().threshold != model.threshold) {
        return fmt::format("is for a threshold of {}, the model has {}",
                           certificate.levels.front().threshold, model.threshold);
    }
    for (const GateLevel& level :
         model.kind == "gate-level" ? model.levels : std::vector<GateLevel>{}) {
        const bool proved = std::any_of(
            certificate.levels.begin(), certificate.levels.end(), [&](const CertificateLevel& l) {
                return l.margin >= level.value && l.threshold >= level.threshold &&
                       l.unproved.empty();
            });
        if (proved) continue;
        return fmt::format("does not prove that the guard is above {} where the logit is below {}",
                           level.value, level.threshold);
    }
    if (const std::string now = fingerprint(model); certificate.fingerprint != now) {
        return fmt::format("is for other weights: their fingerprint was {}, it is {}",
                           certificate.fingerprint, now);
    }
    return {};
}

namespace {

Certificate valid_certificate(const Model& model)
{
    if (model.certificate.empty()) {
        throw std::invalid_argument(
            "Certified: the model has no certificate; `ricochet certify` or learn::certify makes "
            "one");
    }
    if (const std::string why = why_void(model); !why.empty()) {
        throw std::invalid_argument("Certified: the certificate is void: it " + why);
    }
    return parse_certificate(model.certificate);
}

}  // namespace

CertifiedClassifier::CertifiedClassifier(Model model)
    : certificate_(valid_certificate(model)), classifier_(std::move(model))
{
}

bool CertifiedClassifier::holds(const CertificateLevel& level, double logit,
                                const double* features) const noexcept
{
    if (!(logit < level.threshold)) return false;
    return std::none_of(level.unproved.begin(), level.unproved.end(), [&](const auto& box) {
        for (std::size_t i = 0; i < box.size(); ++i) {
            if (!(box[i].lower <= features[i] && features[i] <= box[i].upper)) return false;
        }
        return true;
    });
}

bool CertifiedClassifier::clears(const double* features) const noexcept
{
    return classifier_.in_domain(features) &&
           holds(certificate_.levels.front(), classifier_.logit(features), features);
}

double CertifiedClassifier::lower_bound(const double* features) const noexcept
{
    constexpr double none = -std::numeric_limits<double>::infinity();
    if (!classifier_.in_domain(features)) return none;
    const double logit = classifier_.logit(features);
    for (std::size_t k = certificate_.levels.size(); k-- > 0;) {
        if (holds(certificate_.levels[k], logit, features)) return certificate_.levels[k].margin;
    }
    return none;
}

}  // namespace ricochet
