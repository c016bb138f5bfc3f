% Simulink: the exported plant of pneucli behind a step of the command.
% Needs MATLAB and Simulink R2023b or later (FMI 3.0). Not run by the project, which has no MATLAB.
fmu = fullfile(pwd, 'pneucli_plant.fmu');
model = 'pneucli_plant_example';

new_system(model);
open_system(model);
plant = [model '/Plant'];
add_block('simulink_extras/FMU Import/FMU', plant, 'FMUName', fmu);
set_param(plant, 'Position', [250 80 420 320]);

% another mass than identified; the names are those of modelDescription.xml, with _ for each dot
% set_param(plant, 'rig_moving_mass', '5.0');

% the command: 5 V (here the null command) and, after 0.2 s, 6 V; the port u is the first input
add_block('simulink/Sources/Step', [model '/u'], 'Time', '0.2', 'Before', '5', 'After', '6');
add_line(model, 'u/1', 'Plant/1');

% x, v, a, p1, p2, temperature, flow, chamber_1.p, chamber_2.p: the first and the fourth output
add_block('simulink/Sinks/Scope', [model '/x']);
add_line(model, 'Plant/1', 'x/1');
add_block('simulink/Sinks/Scope', [model '/p1']);
add_line(model, 'Plant/4', 'p1/1');

set_param(model, 'SolverType', 'Fixed-step', 'FixedStep', '1e-3', 'StopTime', '2');
sim(model);
