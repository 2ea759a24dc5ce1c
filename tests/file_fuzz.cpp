// Broken files of every format, made from valid ones, by the hundred thousand.
//
//     file_fuzz [format] [count] [seed]
//
// A file is either refused with the exception that its format promises, or its content is
// used. Any other behaviour ends the program; run it under the address and undefined-behaviour
// sanitizers. Each file depends only on the seed and its own number, so that a failure can be
// repeated.
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <exception>
#include <map>
#include <string>
#include <string_view>

#include "file_formats.hpp"

namespace {

using namespace ricochet;
using namespace ricochet::file_fuzz;

/// The kind of a refusal: its words up to the value found, without names and numbers.
std::string kind_of(std::string_view message)
{
    std::string kind;
    bool quoted = false;
    for (const char c : message.substr(0, message.find("found"))) {
        if (c == '"' || c == '\'') quoted = !quoted;
        const bool letter = (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z');
        if (!quoted && (letter || c == ' ' || c == ':')) kind += c;
    }
    return kind;
}

struct Counts {
    std::uint64_t refused = 0;
    std::uint64_t loaded = 0;
    std::map<std::string, std::uint64_t> reasons;
};

void attempt(const Format& format, const std::string& bytes, Mutator& mutator, Counts& counts)
{
    // A copy of exactly this size, so that the sanitizer sees a read beyond it.
    const std::string exact(bytes.begin(), bytes.end());
    try {
        format.load_and_use(exact, mutator);
        ++counts.loaded;
    } catch (const Refused& refused) {
        ++counts.refused;
        ++counts.reasons[kind_of(refused.why)];
    }
}

/// @return whether all files pass
bool run(const std::string& name, const Format& format, std::uint64_t count, std::uint64_t seed)
{
    Counts sound;
    for (std::size_t i = 0; i < format.sound_count(); ++i) {
        Mutator mutator(0);
        attempt(format, format.sound(i), mutator, sound);
    }
    if (sound.refused > 0) {
        std::printf("%s: a sound file was refused: %s\n", name.c_str(),
                    sound.reasons.begin()->first.c_str());
        return false;
    }
    Counts counts;
    for (std::uint64_t done = 0; done < count; ++done) {
        Mutator mutator((seed << 32) + done);
        try {
            attempt(format, format.broken(mutator), mutator, counts);
        } catch (const std::exception& error) {
            std::printf("%s: file %llu with seed %llu: unexpected: %s\n", name.c_str(),
                        static_cast<unsigned long long>(done),
                        static_cast<unsigned long long>(seed), error.what());
            return false;
        }
    }
    std::printf("%s: %llu files, %llu refused for %zu reasons, %llu loaded and used\n",
                name.c_str(), static_cast<unsigned long long>(count),
                static_cast<unsigned long long>(counts.refused), counts.reasons.size(),
                static_cast<unsigned long long>(counts.loaded));
    if (std::getenv("RICOCHET_FUZZ_REASONS") != nullptr) {
        for (const auto& [reason, times] : counts.reasons) {
            std::printf("%8llu %s\n", static_cast<unsigned long long>(times), reason.c_str());
        }
    }
    return true;
}

}  // namespace

int main(int argc, char** argv)
{
    const std::string wanted = argc > 1 ? argv[1] : "all";
    const std::uint64_t count = argc > 2 ? std::strtoull(argv[2], nullptr, 10) : 5000;
    const std::uint64_t seed = argc > 3 ? std::strtoull(argv[3], nullptr, 10) : 1;
    bool sound = wanted == "all" || formats().contains(wanted);
    if (!sound) std::printf("file_fuzz: unknown format %s\n", wanted.c_str());
    for (const auto& [name, make] : formats()) {
        if (sound && (wanted == "all" || wanted == name)) {
            sound = run(name, *make(), count, seed);
        }
    }
    return sound ? 0 : 1;
}
