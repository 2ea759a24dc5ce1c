// ricochet-fmu-describe LIBRARY VERSION FILE: writes the description that the library of an FMU
// gives.
//
// In C++, so that a build with sanitizers has their runtimes in this program, too.
#include <dlfcn.h>

#include <cstdio>
#include <cstdlib>

namespace {

int fail(const char* what, const char* why)
{
    std::fprintf(stderr, "ricochet-fmu-describe: %s: %s\n", what, why);
    return 1;
}

}  // namespace

int main(int count, char** arguments)
{
    if (count != 4) return fail("found other arguments", "expected LIBRARY VERSION FILE"), 2;
    void* const library = dlopen(arguments[1], RTLD_NOW | RTLD_LOCAL);
    if (library == nullptr) return fail(arguments[1], dlerror());
    using Describe = const char* (*)(int version);
    const auto describe = reinterpret_cast<Describe>(dlsym(library, "ricochet_fmu_description"));
    if (describe == nullptr) return fail(arguments[1], "has no RICOCHET_FMU");
    const char* const text = describe(std::atoi(arguments[2]));
    if (*text != '<') return fail(arguments[1], text);
    std::FILE* const file = std::fopen(arguments[3], "w");
    if (file == nullptr) return fail(arguments[3], "cannot be written");
    const bool written = std::fputs(text, file) >= 0;
    return std::fclose(file) == 0 && written ? 0 : fail(arguments[3], "cannot be written");
}
