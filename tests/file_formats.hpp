// Files of every format: valid ones, broken ones, and the use of those that load.
//
// A file is either refused with the exception that its format promises, or its content is
// used. For file_fuzz.cpp, which breaks them at random, and for libFuzzer (stress/fuzz_files.cpp).
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <exception>
#include <filesystem>
#include <fstream>
#include <functional>
#include <limits>
#include <map>
#include <memory>
#include <span>
#include <stdexcept>
#include <string>
#include <string_view>
#include <vector>

#include "faults/fault_kernel.hpp"
#include "learn/certify_checkpoint.hpp"
#include "learn/checkpoint.hpp"
#include "learn/checkpoint_file.hpp"
#include "mutator.hpp"
#include "nn_models.hpp"
#include "ricochet/faults/friction.hpp"
#include "ricochet/integrate.hpp"
#include "ricochet/learn_steps/policies.hpp"
#include "ricochet/nn/mlp.hpp"
#include "ricochet/nn/model.hpp"
#include "ricochet/scene/simulate.hpp"
#include "ricochet/systems/bouncing_ball.hpp"

namespace ricochet::file_fuzz {

using nlohmann::json;
namespace fs = std::filesystem;

/// The refusal of a file by its format.
struct Refused {
    std::string why;
};

/// Converts exceptions of `use` of the promised kind to `Refused`.
template <class Promised, class Use>
auto refusing(const Use& use)
{
    try {
        return use();
    } catch (const Promised& error) {
        throw Refused{error.what()};
    }
}

class Format {
public:
    virtual ~Format() = default;
    [[nodiscard]] virtual std::string sound(std::size_t which) const = 0;
    [[nodiscard]] virtual std::size_t sound_count() const = 0;
    /// A broken file.
    [[nodiscard]] virtual std::string broken(Mutator& mutator) const = 0;
    /// Loads it and uses its content.
    /// @throws Refused
    virtual void load_and_use(const std::string& bytes, Mutator& mutator) const = 0;
};

// --- models ---

class Safetensors : public Format {
    struct Parts {
        json header;
        std::string data;
    };

public:
    Safetensors()
    {
        for (const auto& widths :
             {std::vector<std::size_t>{1, 1}, {3, 5, 2}, {2, 8, 8, 1}, {4, 16, 16, 1}}) {
            for (const Precision precision : {Precision::f32, Precision::f64}) {
                Model model = random_model(
                    widths, precision == Precision::f32 ? Activation::relu : Activation::tanh, 1);
                model.precision = precision;
                model.parameters = {{"gravity", 9.81}};
                const auto bytes = to_safetensors(model);
                const std::string all(reinterpret_cast<const char*>(bytes.data()), bytes.size());
                std::uint64_t length = 0;
                std::memcpy(&length, all.data(), 8);
                parts_.push_back({json::parse(all.substr(8, length)), all.substr(8 + length)});
            }
        }
    }

    std::size_t sound_count() const override { return parts_.size(); }
    std::string sound(std::size_t which) const override
    {
        return join(parts_[which].header.dump(), parts_[which].data);
    }

    std::string broken(Mutator& mutator) const override
    {
        Parts parts = mutator.any_of(parts_);
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) {
            switch (mutator.below(10)) {
                case 0: mutator.change_numbers(parts.data, 0, 4); break;
                case 1: parts.data.resize(mutator.below(2 * parts.data.size() + 2)); break;
                default: mutator.change(parts.header); break;
            }
        }
        std::string text = parts.header.dump(-1, ' ', false, json::error_handler_t::replace);
        if (mutator.one_in(20)) mutator.break_text(text);
        std::string bytes = join(text, parts.data);
        if (mutator.one_in(30)) {
            const std::uint64_t length =
                mutator.one_in(2) ? mutator.size() : text.size() + mutator.below(9) - 4;
            std::memcpy(bytes.data(), &length, 8);
        }
        if (mutator.one_in(10)) bytes.resize(mutator.below(bytes.size() + 1));
        return bytes;
    }

    void load_and_use(const std::string& bytes, Mutator& mutator) const override
    {
        const LoadOptions options{.allow_non_finite = mutator.one_in(2)};
        const Model model = refusing<ModelError>(
            [&] { return parse_model(std::as_bytes(std::span(bytes)), "f", options); });
        const Classifier classifier(model);
        std::vector<double> features(classifier.inputs(), 0.5);
        std::vector<double> logits(classifier.outputs());
        for (const double x : {0.0, 0.5, -1e300, std::numeric_limits<double>::quiet_NaN()}) {
            features[0] = x;
            classifier.logits(features.data(), logits.data());
            static_cast<void>(classifier.alarm(classifier.logit(features.data())));
            static_cast<void>(classifier.in_domain(features.data()));
        }
        static_cast<void>(parse_model(to_safetensors(model, options), "again", options));
    }

private:
    static std::string join(const std::string& text, const std::string& data)
    {
        const std::uint64_t length = text.size();
        std::string bytes(8, '\0');
        std::memcpy(bytes.data(), &length, 8);
        return bytes + text + data;
    }

    std::vector<Parts> parts_;
};

// --- potentials ---

class Potentials : public Format {
public:
    Potentials()
    {
        for (const std::size_t units : {std::size_t{0}, std::size_t{1}, std::size_t{8}}) {
            AdditivePair::Parameters p;
            p.domain = {.v_min = 1e-7, .v_max = 1e-3, .xi_min = -4, .xi_max = 12};
            for (MonotoneNet* net : {&p.direct, &p.state, &p.rate}) {
                net->units = units;
                net->slope = 0.1;
                for (std::size_t i = 0; i < units; ++i) {
                    net->weight[i] = 0.01 * static_cast<double>(i + 1);
                    net->scale[i] = 0.2;
                    net->shift[i] = static_cast<double>(i) - 3.5;
                }
            }
            documents_.push_back(json::parse(to_json(AdditivePair(p))));
        }
    }

    std::size_t sound_count() const override { return documents_.size(); }
    std::string sound(std::size_t which) const override { return documents_[which].dump(); }

    std::string broken(Mutator& mutator) const override
    {
        json document = mutator.any_of(documents_);
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) mutator.change(document);
        if (!mutator.one_in(4)) repeat_test(document);
        std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
        if (mutator.one_in(10)) mutator.break_text(text);
        return text;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        const AdditivePair pair =
            refusing<PotentialFileError>([&] { return parse_pair(bytes, "f"); });
        const PairDomain& d = pair.parameters().domain;
        if (d.v_max == 0) return;  // it states no domain
        for (const double v : {d.v_min, std::sqrt(d.v_min) * std::sqrt(d.v_max), d.v_max}) {
            for (const double xi : {d.xi_min, (d.xi_min + d.xi_max) / 2, d.xi_max}) {
                const FrictionAndRate at = pair.evaluate(v, xi);
                if (!std::isfinite(at.friction) || !std::isfinite(at.rate)) {
                    throw std::logic_error("friction or rate is not finite within the domain");
                }
                static_cast<void>(pair.gradient(v, xi));
            }
        }
        static_cast<void>(pair.dual(1e-9));
        static_cast<void>(parse_pair(to_json(pair), "again"));
    }

private:
    /// Replaces the stored values by those of the changed weights, as far as they can be computed.
    static void repeat_test(json& document)
    {
        try {
            AdditivePair::Parameters p;
            p.v_star = document.at("v_star");
            p.beta = document.at("beta");
            const auto net = [&](const char* key) {
                const json& in = document.at(key);
                MonotoneNet out{.units = in.at("weight").size(),
                                .offset = in.at("offset"),
                                .slope = in.at("slope")};
                for (std::size_t i = 0; i < std::min(out.units, MonotoneNet::most_units); ++i) {
                    out.weight[i] = in.at("weight").at(i);
                    out.scale[i] = in.at("scale").at(i);
                    out.shift[i] = in.at("shift").at(i);
                }
                return out;
            };
            p.direct = net("direct");
            p.state = net("state");
            p.rate = net("rate");
            json& test = document.at("self_test");
            const FrictionAndRate now = AdditivePair(p).evaluate(test.at("v"), test.at("xi"));
            test["friction"] = now.friction;
            test["rate"] = now.rate;
        } catch (const std::exception&) {
            // The changed value is no number, and stays as it is.
        }
    }

    std::vector<json> documents_;
};

// --- what is read from files only ---

class InFile : public Format {
public:
    InFile()
    {
        std::string name = (fs::temp_directory_path() / "ricochet-fuzz-XXXXXX").string();
        if (mkdtemp(name.data()) == nullptr) throw std::runtime_error("no temporary directory");
        directory_ = name;
    }
    ~InFile() override
    {
        std::error_code ignored;
        fs::remove_all(directory_, ignored);
    }
    InFile(const InFile&) = delete;
    InFile& operator=(const InFile&) = delete;

protected:
    [[nodiscard]] fs::path file() const { return directory_ / "file"; }
    [[nodiscard]] fs::path written(const std::string& bytes) const
    {
        fs::remove(
            file());  // a file that is emptied and written again is waited for by some systems
        std::ofstream(file(), std::ios::binary) << bytes;
        return file();
    }
    [[nodiscard]] std::string read() const
    {
        std::ifstream in(file(), std::ios::binary);
        return {std::istreambuf_iterator<char>(in), {}};
    }

private:
    fs::path directory_;
};

class Npy : public InFile {
    static constexpr std::size_t most = 3;

public:
    std::size_t sound_count() const override { return 12; }
    std::string sound(std::size_t which) const override
    {
        const bool single = which % 2 == 1;
        const std::size_t side = 1 + which / 2 % most;
        return join(header(side, single, which > 5), data(side, single),
                    static_cast<unsigned>(1 + which % 3));
    }

    std::string broken(Mutator& mutator) const override
    {
        const bool single = mutator.one_in(2);
        const std::size_t side = 1 + mutator.below(most);
        std::string text = header(side, single, mutator.one_in(2));
        std::string numbers = data(side, single);
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) {
            if (mutator.one_in(3)) {
                mutator.change_numbers(numbers, 0, single ? 4 : 8);
            } else {
                text = mutator.change_words(text);
            }
        }
        std::string bytes = join(text, numbers, static_cast<unsigned>(mutator.below(5)));
        if (mutator.one_in(4)) mutator.break_bytes(bytes);
        return bytes;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        const Eigen::MatrixXd matrix =
            refusing<std::invalid_argument>([&] { return read_npy_square(written(bytes)); });
        if (matrix.rows() != matrix.cols() || !matrix.allFinite()) {
            throw std::logic_error("a matrix that is not square, or not finite");
        }
    }

private:
    static std::string header(std::size_t side, bool single, bool fortran)
    {
        return "{'descr': '<f" + std::string(single ? "4" : "8") +
               "', 'fortran_order': " + (fortran ? "True" : "False") + ", 'shape': (" +
               std::to_string(side) + ", " + std::to_string(side) + "), }\n";
    }
    static std::string data(std::size_t side, bool single)
    {
        std::string out;
        for (std::size_t i = 0; i < side * side; ++i) {
            const double number = 0.1 * static_cast<double>(i + 1);
            const auto narrow = static_cast<float>(number);
            const std::size_t width = single ? sizeof narrow : sizeof number;
            out.append(single ? reinterpret_cast<const char*>(&narrow)
                              : reinterpret_cast<const char*>(&number),
                       width);
        }
        return out;
    }
    static std::string join(const std::string& text, const std::string& numbers, unsigned version)
    {
        std::string out = "\x93NUMPY";
        out += static_cast<char>(version);
        out += '\0';
        for (unsigned i = 0; i < (version > 1 ? 4U : 2U); ++i) {
            out += static_cast<char>((text.size() >> (8 * i)) & 0xff);
        }
        return out + text + numbers;
    }
};

// --- checkpoints ---

/// Checkpoints of trainings: a line, numbers and their checksum.
class Checkpoints : public InFile {
public:
    Checkpoints()
    {
        learn::Checkpoint training;
        training.parameters = {1, 2, 3};
        training.adam = {.steps = 2, .first = {1, 2, 3}, .second = {1, 2, 3}};
        training.hard = {1, 5};
        training.best_parameters = {1, 2, 3};
        learn::save_checkpoint(training, file());
        sound_.push_back(read());
        learn::GateCheckpoint gate;
        gate.parameters = {1, 2};
        gate.best_parameters = {{1, 2}, {}};
        gate.best_thresholds = {{0.5}, {}};
        learn::save_checkpoint(gate, file());
        sound_.push_back(read());
        search(false);
        sound_.push_back(read());
        reinforce(false);
        sound_.push_back(read());
    }

    std::size_t sound_count() const override { return sound_.size(); }
    std::string sound(std::size_t which) const override { return sound_[which]; }

    std::string broken(Mutator& mutator) const override
    {
        std::string bytes = mutator.any_of(sound_);
        const std::size_t first = bytes.find('\n') + 1;
        // Lists are seldom cut exactly where one begins, so numbers are changed, or omitted in
        // eights.
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) {
            const std::size_t words = (bytes.size() - first) / 8;
            if (words < 4) break;
            const std::size_t at = first + 8 * mutator.below(words - 2);
            switch (mutator.below(4)) {
                case 0: bytes.erase(at, 8 * mutator.below(3)); break;
                case 1: bytes.insert(at, bytes.substr(at, 8 * mutator.below(3))); break;
                default: mutator.change_numbers(bytes, first + mutator.below(2) * 16, 8); break;
            }
        }
        if (!mutator.one_in(5) && bytes.size() >= first + 8) {
            const std::string_view rest = std::string_view(bytes).substr(first);
            const std::uint64_t sum = learn::checksum(rest.substr(0, rest.size() - 8));
            std::memcpy(bytes.data() + bytes.size() - 8, &sum, 8);
        }
        if (mutator.one_in(8)) mutator.break_bytes(bytes);
        return bytes;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        refusing<std::runtime_error>([&] {
            (void)written(bytes);
            const std::string_view line(bytes.data(), std::min(bytes.find('\n'), bytes.size()));
            if (line == "ricochet evolution checkpoint 1") {
                search(true);
            } else if (line.find("gate") != line.npos) {
                learn::save_checkpoint(learn::load_gate_checkpoint(file()), file());
            } else if (line.find("training") != line.npos) {
                learn::save_checkpoint(learn::load_checkpoint(file()), file());
            } else {
                reinforce(true);
            }
        });
    }

private:
    void search(bool resume) const
    {
        const std::vector<double> start{1, 2};
        const learn::Objective score = [](std::span<const double> x) {
            return x[0] * x[0] + x[1] * x[1];
        };
        static_cast<void>(learn::evolve(
            score, start, {.max_evaluations = 20, .checkpoint = file(), .resume = resume}));
    }

    void reinforce(bool resume) const
    {
        learn::Environment world{.observations = 1, .actions = 1};
        world.reset = [](std::uint64_t, std::span<double> o) { o[0] = 0.5; };
        world.step = [](std::span<const double> a, std::span<double> o) {
            o[0] = 0.5;
            return learn::Reaction{.reward = -a[0] * a[0], .truncated = true};
        };
        learn::PolicyTraining training{.steps = 8,
                                       .random_steps = 4,
                                       .batch = 2,
                                       .buffer = 6,
                                       .threads = 1,
                                       .report_every = 8,
                                       .checkpoint = file(),
                                       .resume = resume};
        if (resume) training.steps = 9;
        static_cast<void>(
            learn::train_td3(world, {.training = training, .actor = {2}, .critic = {2}}));
    }

    std::vector<std::string> sound_;
};

/// Checkpoints of proofs, in JSON.
class Proofs : public InFile {
public:
    Proofs()
    {
        learn::Progressed all;
        const std::vector<std::vector<ValueRange>> boxes{{{0, 1}, {2, 3}}, {{1, 2}, {2, 3}}};
        all.levels.push_back(
            {.margin = 0.1, .threshold = 0.5, .boxes = 7, .seconds = 1, .unproved = boxes});
        all.estimates = {{}, {}};
        all.attempt = learn::Attempt{.number = 1};
        learn::Started started;
        started.done.resize(5);
        started.done[1].emplace();
        started.done[1]->boxes = 3;
        started.done[1]->unproved = boxes;
        all.current = std::move(started);
        learn::save(all, "key", file());
        document_ = json::parse(read());
    }

    std::size_t sound_count() const override { return 1; }
    std::string sound(std::size_t /*which*/) const override { return document_.dump(); }

    std::string broken(Mutator& mutator) const override
    {
        json document = document_;
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) mutator.change(document);
        std::string text = document.dump(-1, ' ', false, json::error_handler_t::replace);
        if (mutator.one_in(10)) mutator.break_text(text);
        return text;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        const learn::Progressed all =
            refusing<std::runtime_error>([&] { return learn::load("key", written(bytes)); });
        learn::save(all, "key", file());
        static_cast<void>(learn::load("key", file()));
    }

private:
    json document_;
};

// --- snapshots ---

class Snapshots : public Format {
public:
    Snapshots()
    {
        auto run = simulation();
        for (int i = 0; i < 3; ++i) {
            sound_.push_back(to_text(run.save()));
            for (int k = 0; k < 10; ++k) run.step();
        }
    }

    std::size_t sound_count() const override { return sound_.size(); }
    std::string sound(std::size_t which) const override { return sound_[which]; }

    std::string broken(Mutator& mutator) const override
    {
        std::string text = mutator.any_of(sound_);
        text.erase(text.find(checksum_line));
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) text = mutator.change_words(text);
        char line[40];
        std::snprintf(line, sizeof line, "%s%016llx\n", checksum_line,
                      static_cast<unsigned long long>(learn::checksum(text)));
        if (!mutator.one_in(20)) text += line;
        if (mutator.one_in(10)) mutator.break_bytes(text);
        return text;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        auto run = simulation();
        refusing<std::invalid_argument>([&] { run.restore(snapshot_from_text(bytes)); });
        for (int i = 0; i < 50 && !run.ended(); ++i) run.step();
    }

private:
    static constexpr const char* checksum_line = "checksum ";

    static Simulation<BouncingBall, std::array<double, 2>> simulation()
    {
        static const BouncingBall ball;
        return {ball, {10, 0}, {.t_end = 10}};
    }

    std::vector<std::string> sound_;
};

// --- scenes ---

/// Without a grid of bodies, of which a changed number asks for as much memory as a scene may have.
class Scenes : public Format {
public:
    std::size_t sound_count() const override { return documents_.size(); }
    std::string sound(std::size_t which) const override { return documents_[which].dump(1); }

    std::string broken(Mutator& mutator) const override
    {
        json document = mutator.any_of(documents_);
        for (std::uint64_t i = mutator.below(3); i < 3; ++i) mutator.change(document);
        std::string text =
            document.dump(mutator.one_in(2) ? 1 : -1, ' ', false, json::error_handler_t::replace);
        if (mutator.one_in(10)) mutator.break_text(text);
        return text;
    }

    void load_and_use(const std::string& bytes, Mutator& /*mutator*/) const override
    {
        const SceneFile file = refusing<SceneFileError>([&] { return read_scene(bytes, "f"); });
        for (const Disc& body : file.scene.bodies()) {
            if (!(body.mass > 0)) throw std::logic_error("a body without mass");
        }
    }

private:
    std::vector<json> documents_{json::parse(R"({
            "gravity": [0, -9.81],
            "materials": {"clay": {"restitution": 0.3, "friction": 0.1}},
            "walls": [{"name": "floor", "normal": [0, 1], "point": [0, 0], "material": "clay"}],
            "bodies": [
                {"name": "a", "disc": {"radius": 0.1, "mass": 1}, "at": [0, 1], "velocity": [1, 0],
                 "drag": 0.05, "material": "clay"},
                {"name": "b", "point": {"mass": 2}, "at": [1, 1]}],
            "springs": [{"between": ["a", "b"], "rest": 1, "stiffness": 10, "damping": 0.1}],
            "run": {"t_end": 2, "rtol": 1e-8, "atol": 1e-10, "impacts": "together",
                    "elastic_within": 1e-6, "contact_step": 1e-3, "sample_times": [0, 1],
                    "max_events": 10}})"),
                                 json::parse(R"({
            "terrain": [{"name": "hill", "points": [[-1, 0], [0, 0.5], [1, 0]],
                         "motion": {"amplitude": [0, 0.05], "frequency": 3, "phase": 0}}],
            "bodies": [{"disc": {}, "at": [0, 2]}],
            "run": {"t_end": 1}})")};
};

/// Every format by its name.
[[nodiscard]] inline const std::map<std::string, std::function<std::unique_ptr<Format>()>>&
formats()
{
    static const std::map<std::string, std::function<std::unique_ptr<Format>()>> all{
        {"safetensors", [] { return std::make_unique<Safetensors>(); }},
        {"potentials", [] { return std::make_unique<Potentials>(); }},
        {"npy", [] { return std::make_unique<Npy>(); }},
        {"checkpoints", [] { return std::make_unique<Checkpoints>(); }},
        {"proofs", [] { return std::make_unique<Proofs>(); }},
        {"scenes", [] { return std::make_unique<Scenes>(); }},
        {"snapshots", [] { return std::make_unique<Snapshots>(); }}};
    return all;
}

}  // namespace ricochet::file_fuzz
