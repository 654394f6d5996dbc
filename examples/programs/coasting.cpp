// Coasting between fixes of GNSS, as a program for simnav: the position moves with the velocity, and a fix replaces it.
// g++ -O2 -o coasting coasting.cpp
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>

int main() {
    double state[9] = {}, time = 0.0, fixed[2] = {}, fixed_at = -1.0;  // lat, lon, h, vn, ve, vd, roll, pitch, yaw
    double sigma = 10.0;
    static char line[65536], *cells[256];
    while (std::fgets(line, sizeof line, stdin)) {
        int n = 0;
        for (char *cell = std::strtok(line, ",\r\n"); cell && n < 256; cell = std::strtok(nullptr, ",\r\n")) cells[n++] = cell;
        if (n == 0) continue;
        if (!std::strcmp(cells[0], "start")) {
            time = std::atof(cells[1]);
            for (int i = 0; i < 9; ++i) state[i] = std::atof(cells[3 + i]);
        } else if (!std::strcmp(cells[0], "begin")) {
            std::puts("ready"), std::fflush(stdout);
        } else if (!std::strcmp(cells[0], "measurement") && !std::strcmp(cells[2], "gnss_position")) {
            const double t = std::atof(cells[3]), lat = std::atof(cells[4]), lon = std::atof(cells[5]);
            if (fixed_at >= 0.0 && t > fixed_at) {  // the velocity is that between two fixes
                state[3] = 6371e3 * (lat - fixed[0]) / (t - fixed_at);
                state[4] = 6371e3 * std::cos(lat) * (lon - fixed[1]) / (t - fixed_at);
            }
            state[0] = fixed[0] = lat, state[1] = fixed[1] = lon, state[2] = std::atof(cells[6]);
            fixed_at = time = t, sigma = 3.0;
        } else if (!std::strcmp(cells[0], "step")) {
            const double now = std::atof(cells[1]), dt = now - time;
            state[0] += state[3] * dt / 6371e3;
            state[1] += state[4] * dt / (6371e3 * std::cos(state[0]));
            time = now, sigma = std::hypot(sigma, 0.5 * dt);
            std::printf("estimate,%.9f", now);
            for (int i = 0; i < 6; ++i) std::printf(",%.17g", state[i]);
            std::printf(",,,");  // the attitude is not estimated
            for (int i = 0; i < 9; ++i) std::printf(",%g", i < 3 ? sigma : i < 6 ? 1.0 : 0.0);
            std::puts(""), std::fflush(stdout);
        }
    }
}
