#include "ricochet/scene/simulate.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <functional>
#include <nlohmann/json.hpp>
#include <unordered_map>

#include "base/read_file.hpp"
#include "base/strict_json.hpp"
#include "scene/json_lines.hpp"
#include "scene/names.hpp"
#include "scene/options.hpp"

namespace ricochet {

using namespace detail;

namespace {

using nlohmann::json;

constexpr int deepest = 8;
constexpr std::uintmax_t longest_file = 1ULL << 32;

/// An error in the value at a path.
struct Trouble {
    JsonPath path;
    std::string what;
};

std::string shown(const json& value)
{
    std::string text = value.dump(-1, ' ', false, json::error_handler_t::replace);
    return text.size() > 40 ? text.substr(0, 37) + "..." : text;
}

/// An object of the file, all of whose keys must be read.
class Part {
public:
    Part(const json& value, JsonPath path, std::string_view what)
        : value_(value), path_(std::move(path)), what_(what)
    {
        if (!value.is_object()) {
            fail(fmt::format("expected an object for {}, found {}", what, shown(value)));
        }
    }

    [[noreturn]] void fail(std::string sentence) const
    {
        throw Trouble{path_, std::move(sentence)};
    }
    [[noreturn]] void fail_at(std::string_view key, std::string sentence) const
    {
        JsonPath path = path_;
        path.emplace_back(std::string(key));
        throw Trouble{std::move(path), std::move(sentence)};
    }

    /// Refuses keys of other names.
    void only(std::initializer_list<std::string_view> known) const
    {
        for (const auto& item : value_.items()) {
            if (std::ranges::find(known, item.key()) == known.end()) {
                fail_at(item.key(), fmt::format("unknown key \"{}\" in {}{}", item.key(), what_,
                                                nearest_name(item.key(), known)));
            }
        }
    }

    [[nodiscard]] bool has(std::string_view key) const { return value_.contains(std::string(key)); }
    [[nodiscard]] const json& at(std::string_view key) const
    {
        const auto found = value_.find(std::string(key));
        if (found == value_.end()) fail(fmt::format("expected \"{}\" in {}", key, what_));
        return *found;
    }
    [[nodiscard]] JsonPath path_to(std::string_view key) const
    {
        JsonPath path = path_;
        path.emplace_back(std::string(key));
        return path;
    }
    [[nodiscard]] Part part(std::string_view key, std::string_view what) const
    {
        return {at(key), path_to(key), what};
    }

    [[nodiscard]] double number(std::string_view key) const
    {
        const json& value = at(key);
        if (!value.is_number()) expected("a number", key, value);
        return value.get<double>();
    }
    void number(std::string_view key, double& to) const
    {
        if (has(key)) to = number(key);
    }
    [[nodiscard]] Vector2 vector(std::string_view key) const
    {
        return vector_of(at(key), path_to(key), key);
    }
    void vector(std::string_view key, Vector2& to) const
    {
        if (has(key)) to = vector(key);
    }
    [[nodiscard]] static Vector2 vector_of(const json& value, JsonPath path, std::string_view key)
    {
        if (!value.is_array() || value.size() != 2 || !value[0].is_number() ||
            !value[1].is_number()) {
            throw Trouble{std::move(path), fmt::format("expected two numbers for \"{}\", found {}",
                                                       key, shown(value))};
        }
        return {value[0].get<double>(), value[1].get<double>()};
    }
    void text(std::string_view key, std::string& to) const
    {
        if (!has(key)) return;
        if (!at(key).is_string()) expected("a text", key, at(key));
        to = at(key).get<std::string>();
    }
    void truth(std::string_view key, bool& to) const
    {
        if (!has(key)) return;
        if (!at(key).is_boolean()) expected("true or false", key, at(key));
        to = at(key).get<bool>();
    }
    /// Calls `function(value, path)` for each entry of a list, if there is a list.
    void each(std::string_view key,
              const std::function<void(const json&, const JsonPath&)>& function) const
    {
        if (!has(key)) return;
        const json& list = at(key);
        if (!list.is_array()) expected("a list", key, list);
        JsonPath path = path_to(key);
        path.emplace_back(std::size_t{0});
        for (std::size_t i = 0; i < list.size(); ++i) {
            path.back() = i;
            function(list[i], path);
        }
    }
    [[noreturn]] void expected(std::string_view what, std::string_view key, const json& found) const
    {
        fail_at(key, fmt::format("expected {} for \"{}\", found {}", what, key, shown(found)));
    }

    /// Makes a call that the scene may refuse; a refusal is reported for this part.
    template <class Call>
    auto ask(const Call& call) const
    {
        try {
            return call();
        } catch (const std::invalid_argument& error) {
            fail(error.what());
        }
    }

private:
    const json& value_;
    JsonPath path_;
    std::string_view what_;
};

class Reader {
public:
    SceneFile read(const json& whole)
    {
        const Part top(whole, {}, "a scene");
        top.only({"gravity", "period", "memory_limit", "materials", "pairs", "bodies", "walls",
                  "terrain", "arcs", "plates", "springs", "run"});
        Scene::Settings settings;
        top.vector("gravity", settings.gravity);
        top.vector("period", settings.period);
        top.number("memory_limit", settings.memory_limit);
        SceneFile file{top.ask([&] { return Scene(settings); }), {}};
        materials(top, file.scene);
        top.each("pairs", [&](const json& value, const JsonPath& path) {
            pair({value, path, "a pair"}, file.scene);
        });
        top.each("walls", [&](const json& value, const JsonPath& path) {
            wall({value, path, "a wall"}, file.scene);
        });
        top.each("terrain", [&](const json& value, const JsonPath& path) {
            terrain({value, path, "terrain"}, file.scene);
        });
        top.each("arcs", [&](const json& value, const JsonPath& path) {
            arc({value, path, "an arc"}, file.scene);
        });
        std::vector<std::size_t> ends;  // of the bodies of each entry
        top.each("bodies", [&](const json& value, const JsonPath& path) {
            body({value, path, "a body"}, file.scene);
            ends.push_back(file.scene.bodies().size());
        });
        const std::size_t bodies = file.scene.bodies().size();
        top.each("plates", [&](const json& value, const JsonPath& path) {
            plate({value, path, "a plate"}, file.scene);
        });
        try {
            double t_start = 0;
            if (top.has("run")) top.part("run", "\"run\"").number("t_start", t_start);
            file.scene.check(t_start);
        } catch (const Misplaced& error) {
            if (error.body >= bodies) throw Trouble{{"plates", error.body - bodies}, error.what()};
            const auto entry = std::ranges::upper_bound(ends, std::size_t{error.body});
            const auto index = static_cast<std::size_t>(entry - ends.begin());
            throw Trouble{{"bodies", index}, error.what()};
        } catch (const std::invalid_argument& error) {
            throw Trouble{{}, error.what()};
        }
        top.each("springs", [&](const json& value, const JsonPath& path) {
            spring({value, path, "a spring"}, file.scene);
        });
        if (top.has("run")) run(top.part("run", "\"run\""), file.options);
        return file;
    }

private:
    void materials(const Part& top, Scene& scene)
    {
        if (!top.has("materials")) return;
        static_cast<void>(top.part("materials", "\"materials\""));
        for (const auto& item : top.at("materials").items()) {
            JsonPath path = top.path_to("materials");
            path.emplace_back(item.key());
            const Part part(item.value(), path, "a material");
            part.only({"restitution", "friction"});
            Material material{.name = item.key()};
            material.by_speed = restitution_of(part, material.restitution);
            part.number("friction", material.friction);
            materials_.emplace(item.key(), part.ask([&] { return scene.material(material); }));
        }
    }

    /// Reads a number, or an object that says how restitution depends on the speed.
    [[nodiscard]] static SpeedLaw restitution_of(const Part& of, double& restitution)
    {
        if (!of.has("restitution")) return {};
        if (!of.at("restitution").is_object()) {
            of.number("restitution", restitution);
            return {};
        }
        const Part part = of.part("restitution", "a restitution");
        if (part.has("speeds") || part.has("restitutions")) {
            part.only({"speeds", "restitutions"});
            TableOfSpeed table;
            for (auto [key, to] : {std::pair("speeds", &table.speeds),
                                   std::pair("restitutions", &table.restitutions)}) {
                static_cast<void>(part.at(key));
                part.each(key, [&, name = key, list = to](const json& value, const JsonPath&) {
                    if (!value.is_number()) part.expected("numbers", name, value);
                    list->push_back(value.get<double>());
                });
            }
            return table;
        }
        part.only({"above", "speed", "exponent", "speeds", "restitutions"});
        PowerOfSpeed power;
        restitution = part.number("above");
        power.speed = part.number("speed");
        part.number("exponent", power.exponent);
        return power;
    }

    void pair(const Part& part, Scene& scene) const
    {
        part.only({"between", "restitution", "friction"});
        const json& ends = part.at("between");
        if (!ends.is_array() || ends.size() != 2 || !ends[0].is_string() || !ends[1].is_string()) {
            part.expected("two names of materials", "between", ends);
        }
        MaterialPair pair;
        for (std::size_t k = 0; k < 2; ++k) {
            pair.between[k] = material_named(part, "between", ends[k].get<std::string>());
        }
        pair.by_speed = restitution_of(part, pair.restitution);
        part.number("friction", pair.friction);
        part.ask([&] { scene.pair(pair); });
    }

    [[nodiscard]] MaterialId material_named(const Part& part, std::string_view key,
                                            const std::string& name) const
    {
        const auto found = materials_.find(name);
        if (found != materials_.end()) return found->second;
        std::vector<std::string> known;
        for (const auto& [one, id] : materials_) known.push_back(one);
        part.fail_at(key,
                     fmt::format("there is no material \"{}\"{}", name, nearest_name(name, known)));
    }

    [[nodiscard]] MaterialId material_of(const Part& part) const
    {
        std::string name;
        part.text("material", name);
        return part.has("material") ? material_named(part, "material", name) : MaterialId{};
    }

    [[nodiscard]] static SurfaceMotion motion_of(const Part& of)
    {
        if (!of.has("motion")) return {};
        const Part part = of.part("motion", "a motion");
        if (part.has("amplitude")) {
            part.only({"amplitude", "frequency", "phase"});
            Oscillation motion{.amplitude = part.vector("amplitude")};
            part.number("frequency", motion.frequency);
            part.number("phase", motion.phase);
            return motion;
        }
        if (part.has("velocity")) {
            part.only({"velocity", "since"});
            ConstantVelocity motion{.velocity = part.vector("velocity")};
            part.number("since", motion.since);
            return motion;
        }
        part.only(
            {"times", "displacements", "amplitude", "frequency", "phase", "velocity", "since"});
        if (!part.has("times") || !part.has("displacements")) {
            part.fail(
                "expected \"amplitude\", \"velocity\", or \"times\" and "
                "\"displacements\" in a motion");
        }
        part.only({"times", "displacements"});
        PiecewiseLinear motion;
        part.each("times", [&](const json& value, const JsonPath&) {
            if (!value.is_number()) part.expected("numbers", "times", value);
            motion.times.push_back(value.get<double>());
        });
        part.each("displacements", [&](const json& value, const JsonPath& path) {
            motion.displacements.push_back(Part::vector_of(value, path, "displacements"));
        });
        return motion;
    }

    void wall(const Part& part, Scene& scene) const
    {
        part.only({"name", "point", "normal", "material", "motion", "temperature"});
        Wall wall{.point = part.vector("point"), .normal = part.vector("normal")};
        part.text("name", wall.name);
        wall.material = material_of(part);
        wall.motion = motion_of(part);
        part.number("temperature", wall.temperature);
        part.ask([&] { return scene.wall(wall); });
    }

    void terrain(const Part& part, Scene& scene) const
    {
        part.only({"name", "points", "closed", "material", "motion", "temperature"});
        Terrain terrain;
        part.text("name", terrain.name);
        part.truth("closed", terrain.closed);
        static_cast<void>(part.at("points"));
        part.each("points", [&](const json& value, const JsonPath& path) {
            terrain.points.push_back(Part::vector_of(value, path, "points"));
        });
        terrain.material = material_of(part);
        terrain.motion = motion_of(part);
        part.number("temperature", terrain.temperature);
        part.ask([&] { return scene.terrain(terrain); });
    }

    void arc(const Part& part, Scene& scene) const
    {
        part.only({"name", "centre", "radius", "from", "to", "material", "temperature"});
        Arc arc{.centre = part.vector("centre")};
        part.text("name", arc.name);
        if (part.has("radius") == (part.has("from") || part.has("to"))) {
            part.fail(
                fmt::format(R"(expected either "radius", or "from" and "to" in an arc, found {})",
                            part.has("radius") ? "both" : "neither"));
        }
        if (part.has("radius")) {
            arc.radius = part.number("radius");
            if (!(arc.radius > 0)) part.expected("a positive number", "radius", part.at("radius"));
        } else {
            arc.ends = {part.vector("from"), part.vector("to")};
        }
        arc.material = material_of(part);
        part.number("temperature", arc.temperature);
        part.ask([&] { return scene.arc(arc); });
    }

    void body(const Part& part, Scene& scene) const
    {
        part.only({"name", "disc", "point", "at", "velocity", "angle", "spin", "drag", "material",
                   "grid", "spacing"});
        if (part.has("disc") == part.has("point")) {
            part.fail(part.has("disc") ? R"(expected "disc" or "point" in a body, found both)"
                                       : R"(expected "disc" or "point" in a body, found neither)");
        }
        Disc disc{.at = part.vector("at"), .radius = 0};
        part.text("name", disc.name);
        part.vector("velocity", disc.velocity);
        part.number("drag", disc.drag);
        disc.material = material_of(part);
        const bool point = part.has("point");
        const Part shape = part.part(point ? "point" : "disc", point ? "a point" : "a disc");
        if (point) {
            shape.only({"mass"});
        } else {
            shape.only({"radius", "mass", "inertia"});
            disc.radius = Disc{}.radius;
            shape.number("radius", disc.radius);
            part.number("angle", disc.angle);
            part.number("spin", disc.spin);
        }
        for (const std::string_view key : {"angle", "spin"}) {
            if (point && part.has(key)) part.fail_at(key, R"(a point has no angle and no spin)");
        }
        shape.number("mass", disc.mass);
        if (shape.has("inertia")) disc.inertia = inertia_of(shape, disc);
        if (part.has("grid")) return grid(part, disc, point, scene);
        if (part.has("spacing")) part.fail_at("spacing", R"(expected "grid" with "spacing")");
        part.ask([&] { add(scene, disc, point); });
    }

    void plate(const Part& part, Scene& scene) const
    {
        part.only({"name", "from", "to", "along", "speed", "mass", "material"});
        Plate plate{.ends = {part.vector("from"), part.vector("to")}};
        part.text("name", plate.name);
        part.vector("along", plate.along);
        part.number("speed", plate.speed);
        part.number("mass", plate.mass);
        plate.material = material_of(part);
        part.ask([&] { return scene.plate(plate); });
    }

    /// A number, or the inertia of a solid disc or of a ring.
    [[nodiscard]] static double inertia_of(const Part& shape, const Disc& disc)
    {
        const json& value = shape.at("inertia");
        const double ring = disc.mass * disc.radius * disc.radius;
        if (value == "solid") return 0.5 * ring;
        if (value == "ring") return ring;
        if (!value.is_number()) shape.expected(R"(a number, "solid" or "ring")", "inertia", value);
        return value.get<double>();
    }

    static void add(Scene& scene, const Disc& disc, bool point)
    {
        if (!point) {
            scene.disc(disc);
        } else {
            scene.point({disc.name, disc.at, disc.velocity, disc.mass, disc.drag, disc.material});
        }
    }

    /// Rows and columns of one body; a name is followed by its numbers.
    static void grid(const Part& part, const Disc& first, bool point, Scene& scene)
    {
        const Vector2 count = part.vector("grid");
        const Vector2 spacing = part.vector("spacing");
        for (const double n : count) {
            if (!(n >= 1) || n != std::floor(n)) {
                part.fail_at("grid",
                             fmt::format("expected two whole numbers for \"grid\", found {}",
                                         shown(part.at("grid"))));
            }
        }
        part.ask([&] { scene.require_room(count[0] * count[1]); });
        const auto columns = static_cast<std::size_t>(count[0]);
        const auto rows = static_cast<std::size_t>(count[1]);
        for (std::size_t y = 0; y < rows; ++y) {
            for (std::size_t x = 0; x < columns; ++x) {
                Disc disc = first;
                disc.at = {first.at[0] + static_cast<double>(x) * spacing[0],
                           first.at[1] + static_cast<double>(y) * spacing[1]};
                if (!disc.name.empty()) disc.name += fmt::format(" {} {}", x, y);
                part.ask([&] { add(scene, disc, point); });
            }
        }
    }

    static void spring(const Part& part, Scene& scene)
    {
        part.only({"between", "rest", "stiffness", "damping"});
        const json& ends = part.at("between");
        if (!ends.is_array() || ends.size() != 2 || !ends[0].is_string() || !ends[1].is_string()) {
            part.expected("two names of bodies", "between", ends);
        }
        part.ask([&] {
            Spring spring{.between = {scene.body(ends[0].get<std::string>()),
                                      scene.body(ends[1].get<std::string>())}};
            part.number("rest", spring.rest);
            part.number("stiffness", spring.stiffness);
            part.number("damping", spring.damping);
            scene.spring(spring);
        });
    }

    static void run(const Part& part, SceneOptions& options)
    {
        part.only({"t_start", "t_end", "rtol", "atol", "impacts", "elastic_within", "contact_step",
                   "crowded_from", "sample_times", "max_events", "record_events", "seed"});
        part.number("t_start", options.t_start);
        part.number("t_end", options.t_end);
        part.number("rtol", options.rtol);
        part.number("atol", options.atol);
        part.number("elastic_within", options.elastic_within);
        part.number("contact_step", options.contact_step);
        const auto whole = [&](const char* key, std::uint64_t& value) {
            if (!part.has(key)) return;
            const json& given = part.at(key);
            if (!given.is_number_unsigned()) part.expected("a whole number", key, given);
            value = given.get<std::uint64_t>();
        };
        whole("max_events", options.max_events);
        whole("seed", options.seed);
        whole("crowded_from", options.crowded_from);
        if (part.has("record_events")) {
            const json& kept = part.at("record_events");
            if (!kept.is_boolean()) part.expected("true or false", "record_events", kept);
            options.record_events = kept.get<bool>();
        }
        std::string law = "waves";
        part.text("impacts", law);
        if (law != "waves" && law != "together") {
            part.expected(R"("waves" or "together")", "impacts", part.at("impacts"));
        }
        options.impacts = law == "waves" ? ImpactLaw::waves : ImpactLaw::together;
        part.each("sample_times", [&](const json& value, const JsonPath&) {
            if (!value.is_number()) part.expected("numbers", "sample_times", value);
            options.sample_times.push_back(value.get<double>());
        });
    }

    std::unordered_map<std::string, MaterialId> materials_;
};

/// The line to which a parser's message refers, by a count of bytes or the name of a key.
std::size_t line_of_trouble(std::string_view text, std::string_view message)
{
    try {
        const json whole = json::parse(text);
    } catch (const json::parse_error& error) {
        return line_of_byte(text, error.byte > 0 ? error.byte - 1 : 0);
    } catch (const json::exception&) {
        return line_of_large_number(text);
    }
    const std::size_t from = message.find('"');
    const std::size_t to = message.rfind('"');
    if (from == std::string_view::npos || to <= from) return 1;
    const std::size_t line = line_of_repeated(text, message.substr(from + 1, to - from - 1));
    return line > 0 ? line : 1;
}

}  // namespace

SceneFile read_scene(std::string_view text, std::string_view file)
{
    json whole;
    try {
        whole = parse_strictly(text, deepest);
    } catch (const JsonTooDeep& error) {
        throw SceneFileError(
            fmt::format("{}:{}: {}", file, line_of_depth(text, deepest), error.what()));
    } catch (const JsonTrouble& error) {
        throw SceneFileError(
            fmt::format("{}:{}: {}", file, line_of_trouble(text, error.what()), error.what()));
    }
    try {
        return Reader().read(whole);
    } catch (const Trouble& trouble) {
        throw SceneFileError(
            fmt::format("{}:{}: {}", file, line_of(text, trouble.path), trouble.what));
    }
}

SceneFile load_scene(const std::string& path)
{
    const auto refuse = [&](const std::string& why) {
        throw SceneFileError(fmt::format("{}: {}", path, why));
    };
    return read_scene(read_file(path, refuse, longest_file), path);
}

}  // namespace ricochet
