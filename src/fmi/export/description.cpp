#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <string_view>

#include "fmi/export/references.hpp"

namespace ricochet::fmi::detail {

namespace {

constexpr std::array order = {Quantity::time,      Quantity::state,  Quantity::rate,
                              Quantity::parameter, Quantity::input,  Quantity::output,
                              Quantity::indicator, Quantity::events, Quantity::mode};

std::string escaped(std::string_view text)
{
    std::string out;
    for (const char c : text) {
        switch (c) {
            case '<': out += "&lt;"; break;
            case '>': out += "&gt;"; break;
            case '&': out += "&amp;"; break;
            case '"': out += "&quot;"; break;
            default: out += c;
        }
    }
    return out;
}

class Writer {
public:
    Writer(const ModelFacts& facts, int version, std::string_view token)
        : facts_(facts), two_(version == 2), token_(token)
    {
    }

    std::string write()
    {
        text_ = fmt::format(
            "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<fmiModelDescription fmiVersion=\"{}\" "
            "modelName=\"{}\" {}=\"{}\" generationTool=\"ricochet\"",
            two_ ? "2.0" : "3.0", escaped(facts_.name), two_ ? "guid" : "instantiationToken",
            token_);
        if (two_) {
            text_ += " variableNamingConvention=\"structured\"";
            if (facts_.model_exchange) {
                text_ += fmt::format(" numberOfEventIndicators=\"{}\"", facts_.guards.size());
            }
        } else {
            text_ += " variableNamingConvention=\"structured\"";
        }
        text_ += ">\n";
        write_interfaces();
        write_units();
        text_ += fmt::format(
            "<DefaultExperiment startTime=\"{}\" stopTime=\"{}\"/>\n"
            "<ModelVariables>\n",
            facts_.t_start, facts_.t_end);
        write_variables();
        text_ += "</ModelVariables>\n<ModelStructure>\n";
        two_ ? write_structure2() : write_structure3();
        return text_ + "</ModelStructure>\n</fmiModelDescription>\n";
    }

private:
    void write_interfaces()
    {
        const std::string_view saves =
            two_ ? "canGetAndSetFMUstate=\"true\" canSerializeFMUstate=\"true\""
                 : "canGetAndSetFMUState=\"true\" canSerializeFMUState=\"true\"";
        const std::string identifier = escaped(facts_.identifier);
        if (facts_.model_exchange) {
            text_ += fmt::format("<ModelExchange modelIdentifier=\"{}\"{} {}/>\n", identifier,
                                 two_ ? " completedIntegratorStepNotNeeded=\"true\"" : "", saves);
        }
        if (facts_.co_simulation) {
            text_ += fmt::format(
                "<CoSimulation modelIdentifier=\"{}\" "
                "canHandleVariableCommunicationStepSize=\"true\"{} {}/>\n",
                identifier,
                two_ ? "" : " hasEventMode=\"true\" mightReturnEarlyFromDoStep=\"true\"", saves);
        }
    }

    void write_units()
    {
        std::vector<std::string_view> units;
        for (const auto* all :
             {&facts_.states, &facts_.parameters, &facts_.inputs, &facts_.outputs}) {
            for (const Exported& variable : *all) units.emplace_back(variable.unit);
        }
        std::ranges::sort(units);
        units.erase(std::unique(units.begin(), units.end()), units.end());
        std::erase(units, "");
        if (units.empty()) return;
        text_ += "<UnitDefinitions>\n";
        for (const std::string_view unit : units) {
            text_ += fmt::format("<Unit name=\"{}\"/>\n", escaped(unit));
        }
        text_ += "</UnitDefinitions>\n";
    }

    struct Attributes {
        std::string_view name, causality, variability, initial{}, unit{}, description{};
        std::optional<double> start{};
        std::optional<std::size_t> state{};  ///< of which it is the rate
        bool reinit = false, whole = false;
    };

    void add(Quantity quantity, std::size_t index, const Attributes& a)
    {
        const std::string_view type =
            a.whole ? (two_ ? "Integer" : "Int32") : (two_ ? "Real" : "Float64");
        text_ +=
            fmt::format("<{} name=\"{}\" valueReference=\"{}\"", two_ ? "ScalarVariable" : type,
                        escaped(a.name), reference_of(facts_, quantity, index));
        if (!a.description.empty()) {
            text_ += fmt::format(" description=\"{}\"", escaped(a.description));
        }
        text_ += fmt::format(" causality=\"{}\" variability=\"{}\"", a.causality, a.variability);
        if (!a.initial.empty()) text_ += fmt::format(" initial=\"{}\"", a.initial);
        if (two_) text_ += fmt::format("><{}", type);
        if (!a.unit.empty()) text_ += fmt::format(" unit=\"{}\"", escaped(a.unit));
        if (a.start) text_ += fmt::format(" start=\"{}\"", *a.start);
        if (a.state) {
            // By index from 1 in 2.0, by reference in 3.0: the time is the first variable of all.
            const std::size_t state = reference_of(facts_, Quantity::state, *a.state);
            text_ += fmt::format(" derivative=\"{}\"", two_ ? state + 1 : state);
        }
        if (a.reinit && facts_.model_exchange) text_ += " reinit=\"true\"";
        text_ += two_ ? "/></ScalarVariable>\n" : "/>\n";
    }

    void add_exported(Quantity quantity, const std::vector<Exported>& all, Attributes like)
    {
        for (std::size_t i = 0; i < all.size(); ++i) {
            like.name = all[i].name;
            like.unit = all[i].unit;
            like.description = all[i].description;
            if (quantity != Quantity::output) like.start = all[i].start;
            add(quantity, i, like);
        }
    }

    void write_variables()
    {
        add(Quantity::time, 0,
            {.name = "time", .causality = "independent", .variability = "continuous"});
        add_exported(Quantity::state, facts_.states,
                     {.name = {},
                      .causality = "output",
                      .variability = "continuous",
                      .initial = "exact",
                      .reinit = true});
        for (std::size_t i = 0; i < count_of(facts_, Quantity::rate); ++i) {
            const std::string name = fmt::format("der({})", facts_.states[i].name);
            add(Quantity::rate, i,
                {.name = name,
                 .causality = "local",
                 .variability = "continuous",
                 .initial = "calculated",
                 .state = i});
        }
        add_exported(Quantity::parameter, facts_.parameters,
                     {.name = {},
                      .causality = "parameter",
                      .variability = facts_.tunable ? "tunable" : "fixed",
                      .initial = "exact"});
        add_exported(Quantity::input, facts_.inputs,
                     {.name = {}, .causality = "input", .variability = "continuous"});
        add_exported(Quantity::output, facts_.outputs,
                     {.name = {},
                      .causality = "output",
                      .variability = "continuous",
                      .initial = "calculated"});
        for (std::size_t i = 0; i < facts_.guards.size(); ++i) {
            const std::string name = fmt::format("indicator[{}]", i + 1);
            add(Quantity::indicator, i,
                {.name = name,
                 .causality = "local",
                 .variability = "continuous",
                 .initial = "calculated",
                 .description = facts_.guards[i]});
        }
        add(Quantity::events, 0,
            {.name = "events",
             .causality = "output",
             .variability = "discrete",
             .initial = "calculated",
             .description = "number of events",
             .whole = true});
        if (!facts_.modes) return;
        add(Quantity::mode, 0,
            {.name = "mode",
             .causality = "output",
             .variability = "discrete",
             .initial = "calculated",
             .whole = true});
    }

    /// Calls `add` with the references of all outputs.
    template <class Add>
    void each_output(const Add& add) const
    {
        for (const Quantity quantity :
             {Quantity::state, Quantity::output, Quantity::events, Quantity::mode}) {
            for (std::size_t i = 0; i < count_of(facts_, quantity); ++i) {
                add(reference_of(facts_, quantity, i), quantity != Quantity::state);
            }
        }
    }

    void write_structure2()
    {
        std::string outputs, derivatives, unknowns;
        // Variables are listed in the order of their references, which begins with 0.
        each_output([&](std::uint32_t reference, bool calculated) {
            const std::string unknown = fmt::format("<Unknown index=\"{}\"/>\n", reference + 1);
            outputs += unknown;
            if (calculated) unknowns += unknown;
        });
        for (std::size_t i = 0; i < count_of(facts_, Quantity::rate); ++i) {
            derivatives += fmt::format("<Unknown index=\"{}\"/>\n",
                                       reference_of(facts_, Quantity::rate, i) + 1);
        }
        text_ += fmt::format("<Outputs>\n{}</Outputs>\n", outputs);
        if (!derivatives.empty()) {
            text_ += fmt::format("<Derivatives>\n{}</Derivatives>\n", derivatives);
        }
        text_ += fmt::format("<InitialUnknowns>\n{}{}</InitialUnknowns>\n", derivatives, unknowns);
    }

    void write_structure3()
    {
        std::string derivatives, initial;
        each_output([&](std::uint32_t reference, bool calculated) {
            text_ += fmt::format("<Output valueReference=\"{}\"/>\n", reference);
            if (calculated) {
                initial += fmt::format("<InitialUnknown valueReference=\"{}\"/>\n", reference);
            }
        });
        for (std::size_t i = 0; i < count_of(facts_, Quantity::rate); ++i) {
            const std::uint32_t reference = reference_of(facts_, Quantity::rate, i);
            text_ += fmt::format("<ContinuousStateDerivative valueReference=\"{}\"/>\n", reference);
            derivatives += fmt::format("<InitialUnknown valueReference=\"{}\"/>\n", reference);
        }
        text_ += derivatives + initial;
        for (std::size_t i = 0; facts_.model_exchange && i < facts_.guards.size(); ++i) {
            text_ += fmt::format("<EventIndicator valueReference=\"{}\"/>\n",
                                 reference_of(facts_, Quantity::indicator, i));
        }
    }

    const ModelFacts& facts_;
    bool two_;
    std::string_view token_;
    std::string text_;
};

}  // namespace

std::uint64_t hash(std::string_view text, std::uint64_t start) noexcept
{
    std::uint64_t value = start;
    for (const char c : text) value = (value ^ static_cast<unsigned char>(c)) * 0x100000001b3U;
    return value;
}

std::size_t count_of(const ModelFacts& facts, Quantity quantity)
{
    switch (quantity) {
        case Quantity::time:
        case Quantity::events: return 1;
        case Quantity::state: return facts.states.size();
        case Quantity::rate: return facts.rates ? facts.states.size() : 0;
        case Quantity::parameter: return facts.parameters.size();
        case Quantity::input: return facts.inputs.size();
        case Quantity::output: return facts.outputs.size();
        case Quantity::indicator: return facts.guards.size();
        case Quantity::mode: return facts.modes ? 1 : 0;
        case Quantity::none: break;
    }
    return 0;
}

Place place_of(const ModelFacts& facts, std::uint32_t reference)
{
    std::size_t rest = reference;
    for (const Quantity quantity : order) {
        const std::size_t count = count_of(facts, quantity);
        if (rest < count) return {quantity, rest};
        rest -= count;
    }
    return {};
}

std::uint32_t reference_of(const ModelFacts& facts, Quantity wanted, std::size_t index)
{
    std::size_t reference = index;
    for (const Quantity quantity : order) {
        if (quantity == wanted) break;
        reference += count_of(facts, quantity);
    }
    return static_cast<std::uint32_t>(reference);
}

std::string token(const ModelFacts& facts, int version)
{
    const std::string text = Writer(facts, version, "").write();
    const std::uint64_t high = hash(text);
    const std::uint64_t low = hash(text, high);
    return fmt::format("{{{:08x}-{:04x}-{:04x}-{:04x}-{:012x}}}{}{}", high >> 32,
                       high >> 16 & 0xffff, high & 0xffff, low >> 48, low & 0xffffffffffff,
                       facts.told.empty() ? "" : " ", facts.told);
}

std::string_view told_by(std::string_view token) noexcept
{
    const std::size_t space = token.find(' ');
    return space < token.size() ? token.substr(space + 1) : std::string_view();
}

std::string description(const ModelFacts& facts, int version)
{
    const std::string of = token(facts, version);
    return Writer(facts, version, of).write();
}

}  // namespace ricochet::fmi::detail
