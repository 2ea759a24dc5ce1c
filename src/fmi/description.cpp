// Reading of modelDescription.xml, of both versions.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <limits>
#include <unordered_map>
#include <utility>

#include "fmi/unpacked.hpp"
#include "fmi/xml_place.hpp"

namespace ricochet::fmi {

namespace {

constexpr std::uint64_t most_references = std::numeric_limits<std::uint32_t>::max();
constexpr std::size_t most_elements = 10'000'000;  // of all variables
constexpr std::array<std::string_view, 7> causalities = {
    "structuralParameter", "parameter", "calculatedParameter", "input", "output", "local",
    "independent"};
constexpr std::array<std::string_view, 5> variabilities = {"constant", "fixed", "tunable",
                                                           "discrete", "continuous"};
constexpr std::array<std::pair<std::string_view, Type>, 15> types3 = {{
    {"Float64", Type::float64},
    {"Float32", Type::float32},
    {"Int8", Type::int8},
    {"UInt8", Type::uint8},
    {"Int16", Type::int16},
    {"UInt16", Type::uint16},
    {"Int32", Type::int32},
    {"UInt32", Type::uint32},
    {"Int64", Type::int64},
    {"UInt64", Type::uint64},
    {"Boolean", Type::boolean},
    {"Enumeration", Type::int64},
    {"String", Type::text},
    {"Binary", Type::binary},
    {"Clock", Type::clock},
}};
constexpr std::array<std::pair<std::string_view, Type>, 5> types2 = {{
    {"Real", Type::float64},
    {"Integer", Type::int32},
    {"Enumeration", Type::int32},
    {"Boolean", Type::boolean},
    {"String", Type::text},
}};

template <std::size_t n>
std::optional<Type> type_of(const std::array<std::pair<std::string_view, Type>, n>& types,
                            std::string_view word)
{
    for (const auto& [text, type] : types) {
        if (text == word) return type;
    }
    return std::nullopt;
}

template <std::size_t n>
std::vector<std::string_view> words(const std::array<std::string_view, n>& all)
{
    return {all.begin(), all.end()};
}

class Reader {
public:
    Reader(const std::filesystem::path& xml, const std::string& archive)
        : xml_(xml.string(), archive + "/modelDescription.xml")
    {
        d_.file = archive;
    }

    Description read()
    {
        root_ = xml_.root();
        if (std::string_view(root_.name()) != "fmiModelDescription") {
            xml_.fail(root_, "is no description of an FMU; expected <fmiModelDescription>");
        }
        read_version();
        d_.model_name = xml_.needed(root_, "modelName");
        d_.token = xml_.needed(root_, d_.version == 2 ? "guid" : "instantiationToken");
        d_.tool = XmlFile::text(root_, "generationTool").value_or("");
        d_.about = XmlFile::text(root_, "description").value_or("");
        d_.model_exchange = interface("ModelExchange");
        d_.co_simulation = interface("CoSimulation");
        d_.scheduled_execution = d_.version == 3 && root_.child("ScheduledExecution");
        read_experiment();
        read_units();
        if (d_.version == 2) {
            read_variables2();
            read_structure2();
        } else {
            read_variables3();
            read_structure3();
        }
        return std::move(d_);
    }

private:
    void read_version()
    {
        d_.version_text = xml_.needed(root_, "fmiVersion");
        if (d_.version_text == "2.0") d_.version = 2;
        if (d_.version_text.starts_with("3.")) d_.version = 3;
        if (d_.version == 0) {
            xml_.fail(root_, fmt::format("has fmiVersion = '{}'; expected 2.0 or 3.0",
                                         d_.version_text.substr(0, 20)));
        }
    }

    std::optional<Interface> interface(const char* name)
    {
        const pugi::xml_node node = root_.child(name);
        if (!node) return std::nullopt;
        const bool two = d_.version == 2;
        Interface out;
        out.identifier = xml_.needed(node, "modelIdentifier");
        if (out.identifier.find('/') != std::string::npos || out.identifier.starts_with('.')) {
            xml_.fail(node, fmt::format("has modelIdentifier = '{}'; expected the name of a "
                                        "library without folders",
                                        out.identifier.substr(0, 60)));
        }
        out.once_per_process = xml_.flag(node, "canBeInstantiatedOnlyOncePerProcess");
        out.saves_state = xml_.flag(node, two ? "canGetAndSetFMUstate" : "canGetAndSetFMUState");
        out.needs_completed_step = two ? !xml_.flag(node, "completedIntegratorStepNotNeeded")
                                       : xml_.flag(node, "needsCompletedIntegratorStep");
        out.directional_derivatives = xml_.flag(
            node, two ? "providesDirectionalDerivative" : "providesDirectionalDerivatives");
        out.variable_steps = xml_.flag(node, "canHandleVariableCommunicationStepSize");
        out.event_mode = xml_.flag(node, "hasEventMode");
        out.returns_early = xml_.flag(node, "mightReturnEarlyFromDoStep");
        return out;
    }

    void read_experiment()
    {
        const pugi::xml_node node = root_.child("DefaultExperiment");
        d_.t_start = xml_.number(node, "startTime");
        d_.t_end = xml_.number(node, "stopTime");
        d_.tolerance = xml_.number(node, "tolerance");
        d_.step = xml_.number(node, "stepSize");
    }

    /// Units that declared types give to their variables.
    void read_units()
    {
        for (const pugi::xml_node& type : root_.child("TypeDefinitions").children()) {
            const char* const unit = d_.version == 2 ? type.child("Real").attribute("unit").value()
                                                     : type.attribute("unit").value();
            if (*unit) units_[type.attribute("name").value()] = unit;
        }
    }

    /// What both versions say in the same way. @param typed  the element with start and unit
    Variable variable(const pugi::xml_node& node, const pugi::xml_node& typed, Type type)
    {
        Variable v;
        v.name = xml_.needed(node, "name");
        v.type = type;
        v.reference =
            static_cast<std::uint32_t>(xml_.needed_count(node, "valueReference", most_references));
        v.causality = static_cast<Causality>(xml_.choice(node, "causality", words(causalities), 5));
        const bool real = type == Type::float64 || type == Type::float32;
        const bool parameter = v.causality <= Causality::parameter;
        v.variability =
            static_cast<Variability>(xml_.choice(node, "variability", words(variabilities),
                                                 parameter ? 1U
                                                 : real    ? 4U
                                                           : 3U));
        v.starts_calculated = XmlFile::text(node, "initial").value_or("") == "calculated";
        v.description = XmlFile::text(node, "description").value_or("");
        v.unit = XmlFile::text(typed, "unit").value_or("");
        if (const auto declared = XmlFile::text(typed, "declaredType");
            v.unit.empty() && declared) {
            if (const auto found = units_.find(*declared); found != units_.end()) {
                v.unit = found->second;
            }
        }
        if (is_number(type)) v.start = xml_.numbers(typed, "start");
        return v;
    }

    void add(const pugi::xml_node& node, Variable v)
    {
        if (!names_.emplace(v.name, d_.variables.size()).second) {
            xml_.fail(node, fmt::format("has the name '{}' of another variable", v.name));
        }
        elements_ += v.size;
        if (elements_ > most_elements) {
            xml_.fail(node, fmt::format("is beyond the {} numbers that are read", most_elements));
        }
        nodes_.push_back(node);
        d_.variables.push_back(std::move(v));
    }

    // --- 2.0 ---

    void read_variables2()
    {
        for (const pugi::xml_node& node : root_.child("ModelVariables").children()) {
            if (node.type() != pugi::node_element) continue;
            if (std::string_view(node.name()) != "ScalarVariable") {
                xml_.fail(node, "is no variable; expected <ScalarVariable>");
            }
            pugi::xml_node typed;
            std::optional<Type> type;
            for (const pugi::xml_node& child : node.children()) {
                if (!type && (type = type_of(types2, child.name()))) typed = child;
            }
            if (!type)
                xml_.fail(node,
                          "has no type; expected one of Real, Integer, Enumeration, "
                          "Boolean and String");
            add(node, variable(node, typed, *type));
        }
    }

    /// The variable of a number counted from 1.
    std::size_t indexed(const pugi::xml_node& node, const char* attribute)
    {
        const std::uint64_t index = xml_.needed_count(node, attribute, most_references);
        if (index < 1 || index > d_.variables.size()) {
            xml_.fail(node, fmt::format("has {} = {}; expected 1 to {}, the number of variables",
                                        attribute, index, d_.variables.size()));
        }
        return index - 1;
    }

    void read_structure2()
    {
        d_.indicator_count =
            xml_.count(root_, "numberOfEventIndicators", most_elements).value_or(0);
        const pugi::xml_node structure = root_.child("ModelStructure");
        for (const pugi::xml_node& unknown : structure.child("Derivatives").children("Unknown")) {
            const std::size_t derivative = indexed(unknown, "index");
            const pugi::xml_node real = nodes_[derivative].child("Real");
            if (!real) {
                xml_.fail(unknown, fmt::format("says that '{}' is the rate of a state; expected a "
                                               "Real with the attribute derivative",
                                               d_.variables[derivative].name));
            }
            d_.derivatives.push_back(derivative);
            add_state(real, indexed(real, "derivative"));
        }
        d_.state_count = d_.states.size();
    }

    void add_state(const pugi::xml_node& node, std::size_t state)
    {
        if (d_.variables[state].type != Type::float64) {
            xml_.fail(node, fmt::format("is the rate of '{}', which is not a number of 64 bits",
                                        d_.variables[state].name));
        }
        d_.states.push_back(state);
    }

    // --- 3.0 ---

    void read_variables3()
    {
        const pugi::xml_node variables = root_.child("ModelVariables");
        for (const pugi::xml_node& node : variables.children()) {
            if (node.type() != pugi::node_element) continue;
            const std::optional<Type> type = type_of(types3, node.name());
            if (!type) xml_.fail(node, "is no type of FMI 3.0");
            Variable v = variable(node, node, *type);
            const auto at = d_.variables.size();
            if (!references_.emplace(v.reference, at).second) {
                xml_.fail(node,
                          fmt::format("has valueReference = {} of another variable", v.reference));
            }
            add(node, std::move(v));
        }
        for (std::size_t i = 0; i < d_.variables.size(); ++i) find_size(i);
        for (std::size_t i = 0, count = d_.variables.size(); i < count; ++i) {
            for (const pugi::xml_node& alias : nodes_[i].children("Alias")) {
                Variable v = d_.variables[i];
                v.name = xml_.needed(alias, "name");
                v.description = XmlFile::text(alias, "description").value_or("");
                add(alias, std::move(v));
            }
        }
    }

    /// Lengths of an array are given, or start values of structural parameters.
    void find_size(std::size_t i)
    {
        for (const pugi::xml_node& dimension : nodes_[i].children("Dimension")) {
            std::uint64_t length = 0;
            if (const auto start = xml_.count(dimension, "start", most_elements)) {
                length = *start;
            } else {
                const std::size_t by = referenced(dimension);
                const auto& given = d_.variables[by].start;
                if (given.size() != 1 || !(given[0] >= 0 && given[0] <= most_elements)) {
                    xml_.fail(dimension, fmt::format("takes a length from '{}', which has no start",
                                                     d_.variables[by].name));
                }
                length = static_cast<std::uint64_t>(given[0]);
            }
            Variable& v = d_.variables[i];
            v.dimensions.push_back(length);
            if (length > 0 && v.size > most_elements / length) {
                xml_.fail(dimension,
                          fmt::format("gives '{}' more than {} elements", v.name, most_elements));
            }
            v.size *= length;
        }
        Variable& v = d_.variables[i];
        elements_ += v.size;
        if (elements_ > 2 * most_elements) {
            xml_.fail(nodes_[i],
                      fmt::format("is beyond the {} numbers that are read", most_elements));
        }
        if (v.start.size() > 1 && v.start.size() != v.size) {
            xml_.fail(nodes_[i],
                      fmt::format("has {} start values for {} elements", v.start.size(), v.size));
        }
    }

    std::size_t referenced(const pugi::xml_node& node, const char* attribute = "valueReference")
    {
        const auto reference =
            static_cast<std::uint32_t>(xml_.needed_count(node, attribute, most_references));
        const auto found = references_.find(reference);
        if (found == references_.end()) {
            xml_.fail(node,
                      fmt::format("has {} = {}, which no variable has", attribute, reference));
        }
        return found->second;
    }

    void read_structure3()
    {
        const pugi::xml_node structure = root_.child("ModelStructure");
        for (const pugi::xml_node& node : structure.children("ContinuousStateDerivative")) {
            const std::size_t derivative = referenced(node);
            d_.derivatives.push_back(derivative);
            add_state(node, referenced(nodes_[derivative], "derivative"));
            const auto& state = d_.variables[d_.states.back()];
            if (d_.variables[derivative].size != state.size) {
                xml_.fail(node, fmt::format("'{}' has {} elements, its state '{}' has {}",
                                            d_.variables[derivative].name,
                                            d_.variables[derivative].size, state.name, state.size));
            }
            d_.state_count += state.size;
        }
        for (const pugi::xml_node& node : structure.children("EventIndicator")) {
            const std::size_t indicator = referenced(node);
            d_.indicators.push_back(indicator);
            d_.indicator_count += d_.variables[indicator].size;
        }
    }

    XmlFile xml_;
    pugi::xml_node root_;
    Description d_;
    std::vector<pugi::xml_node> nodes_;  ///< of the variables
    std::unordered_map<std::string, std::size_t> names_;
    std::unordered_map<std::uint32_t, std::size_t> references_;
    std::unordered_map<std::string, std::string> units_;
    std::size_t elements_ = 0;
};

/// The offset of "2,3" in an array; nothing if it has no such element.
std::optional<std::size_t> offset_of(std::string_view indices,
                                     const std::vector<std::size_t>& dimensions)
{
    std::size_t offset = 0;
    for (std::size_t k = 0; k < dimensions.size(); ++k) {
        const std::size_t comma = std::min(indices.find(','), indices.size());
        std::uint64_t index = 0;
        for (const char c : indices.substr(0, comma)) {
            if (c < '0' || c > '9' || index > most_elements) return std::nullopt;
            index = 10 * index + static_cast<std::uint64_t>(c - '0');
        }
        if (index < 1 || index > dimensions[k]) return std::nullopt;
        offset = offset * dimensions[k] + static_cast<std::size_t>(index - 1);
        const bool last = k + 1 == dimensions.size();
        if ((comma == indices.size()) != last) return std::nullopt;
        indices.remove_prefix(last ? comma : comma + 1);
    }
    return offset;
}

}  // namespace

Description read_description(const std::filesystem::path& xml, const std::string& archive)
{
    return Reader(xml, archive).read();
}

std::string_view name(Causality causality) noexcept
{
    return causalities[static_cast<std::size_t>(causality)];
}

std::string_view name(Variability variability) noexcept
{
    return variabilities[static_cast<std::size_t>(variability)];
}

std::optional<Element> Description::find(std::string_view of) const
{
    const auto named = [&](std::string_view wanted) {
        const auto found = std::ranges::find(variables, wanted, &Variable::name);
        return static_cast<std::size_t>(found - variables.begin());
    };
    if (const std::size_t i = named(of); i < variables.size()) return Element{i, 0};
    const std::size_t open = of.rfind('[');
    if (open == std::string_view::npos || !of.ends_with(']')) return std::nullopt;
    const std::size_t i = named(of.substr(0, open));
    if (i == variables.size() || variables[i].dimensions.empty()) return std::nullopt;
    const auto offset =
        offset_of(of.substr(open + 1, of.size() - open - 2), variables[i].dimensions);
    if (!offset) return std::nullopt;
    return Element{i, *offset};
}

std::string Description::name_of(const Element& element) const
{
    const Variable& v = variables[element.variable];
    if (v.dimensions.empty()) return v.name;
    std::string indices;
    std::size_t rest = element.offset;
    for (std::size_t k = v.dimensions.size(); k-- > 0;) {
        const std::string index = std::to_string(rest % v.dimensions[k] + 1);
        indices = indices.empty() ? index : index + "," + indices;
        rest /= v.dimensions[k];
    }
    return fmt::format("{}[{}]", v.name, indices);
}

std::vector<std::string> Description::state_names() const
{
    std::vector<std::string> names;
    for (const std::size_t state : states) {
        for (std::size_t k = 0; k < variables[state].size; ++k)
            names.push_back(name_of({state, k}));
    }
    return names;
}

std::string Description::indicator_name(std::size_t k) const
{
    const std::string number = fmt::format("indicator {}", k + 1);
    std::size_t offset = k;
    for (const std::size_t i : indicators) {
        if (offset < variables[i].size) return fmt::format("{} ({})", number, name_of({i, offset}));
        offset -= variables[i].size;
    }
    return number;
}

}  // namespace ricochet::fmi
