// libFuzzer on the format that the environment names: RICOCHET_FUZZ_FORMAT=safetensors fuzz_files
// corpus/. Half of the mutations are those of file_fuzz, which repairs checksums and keeps
// structure.
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <memory>

#include "file_formats.hpp"

extern "C" std::size_t LLVMFuzzerMutate(std::uint8_t* data, std::size_t size, std::size_t most);

namespace {

using namespace ricochet;
using namespace ricochet::file_fuzz;

const Format& format()
{
    static const std::unique_ptr<Format> chosen = [] {
        const char* name = std::getenv("RICOCHET_FUZZ_FORMAT");
        const auto found = formats().find(name != nullptr ? name : "safetensors");
        if (found == formats().end()) {
            std::fprintf(stderr, "fuzz_files: no format %s\n", name);
            std::exit(2);
        }
        return found->second();
    }();
    return *chosen;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size)
{
    Mutator mutator(1);
    try {
        format().load_and_use({reinterpret_cast<const char*>(data), size}, mutator);
    } catch (const Refused&) {
        // The exception is the one that the format promises.
    }
    return 0;
}

extern "C" std::size_t LLVMFuzzerCustomMutator(std::uint8_t* data, std::size_t size,
                                               std::size_t most, unsigned seed)
{
    Mutator mutator(seed);
    if (mutator.one_in(2)) return LLVMFuzzerMutate(data, size, most);
    const std::string bytes = mutator.one_in(20) ? format().sound(seed % format().sound_count())
                                                 : format().broken(mutator);
    if (bytes.size() > most) return LLVMFuzzerMutate(data, size, most);
    std::memcpy(data, bytes.data(), bytes.size());
    return bytes.size();
}
