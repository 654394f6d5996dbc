% Coasting between fixes of GNSS, as a program for simnav: octave-cli coasting.m, or matlab -batch coasting
% The position moves with the velocity, and a fix replaces it.
octave = exist('OCTAVE_VERSION', 'builtin') > 0;
if octave
    next = @() input('', 's');                   % fgetl would wait for the line after it
else                                             % MATLAB reads its standard input by Java
    in = java.io.BufferedReader(java.io.InputStreamReader(java.lang.System.in));
    next = @() char(in.readLine());
end
radius = 6371e3; time = 0; fixed = [0 0]; fixed_at = -1; sigma = 10;
state = zeros(1, 9);                             % lat, lon, h, vn, ve, vd, roll, pitch, yaw
while true
    try, line = next(); catch, break, end        % the input has ended
    if isempty(line), break, end
    cells = strsplit(line, ',');
    switch cells{1}
        case 'start'
            numbers = str2double(cells(2:end));
            time = numbers(1); state = numbers(3:11);
        case 'begin'
            fprintf('ready\n');
        case 'measurement'
            if ~strcmp(cells{3}, 'gnss_position'), continue, end
            value = str2double(cells(4:7));      % time, latitude, longitude, height
            if fixed_at >= 0 && value(1) > fixed_at
                dt = value(1) - fixed_at;        % the velocity is that between two fixes
                state(4) = radius * (value(2) - fixed(1)) / dt;
                state(5) = radius * cos(value(2)) * (value(3) - fixed(2)) / dt;
            end
            state(1:3) = value(2:4); fixed = value(2:3);
            fixed_at = value(1); time = value(1); sigma = 3;
        case 'step'
            now_ = str2double(cells{2}); dt = now_ - time;
            state(1) = state(1) + state(4) * dt / radius;
            state(2) = state(2) + state(5) * dt / (radius * cos(state(1)));
            time = now_; sigma = hypot(sigma, 0.5 * dt);
            fprintf('estimate,%.9f', now_);
            fprintf(',%.17g', state(1:6));
            fprintf(',,,');                      % the attitude is not estimated
            fprintf(',%g', [sigma sigma sigma 1 1 1 0 0 0]);
            fprintf('\n');
    end
    if octave, fflush(stdout); end               % each line is written at once
end
